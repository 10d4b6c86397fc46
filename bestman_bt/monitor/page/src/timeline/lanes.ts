// Spans into lanes: one lane a node when there is room, else as few lanes as hold them without overlap.

import type { Span } from "../protocol";
import { FAILURE, RUNNING } from "../states";
import type { Tree } from "../tree";

export interface Lane {
  name: string;
  index: number;
  spans: { span: Span; index: number }[];
}

const MOST_PACKED = 3;

function shown(spans: Span[], tree: Tree, leavesOnly: boolean): { span: Span; index: number }[] {
  return spans
    .map((span) => ({ span, index: tree.indexOf(span.uid) }))
    .filter(({ index }) => index >= 0 && (!leavesOnly || tree.nodes[index]!.children.length === 0));
}

/** A lane for each node, in drawing order. */
export function laneByNode(spans: Span[], tree: Tree): Lane[] {
  const lanes = new Map<number, Lane>();
  for (const item of shown(spans, tree, false)) {
    const lane = lanes.get(item.index) ?? { name: tree.nodes[item.index]!.name, index: item.index, spans: [] };
    lane.spans.push(item);
    lanes.set(item.index, lane);
  }
  return [...lanes.values()].sort((a, b) => a.index - b.index);
}

/** Only what leaves did, first come first placed; a failure shows where a long history was merged into it. */
export function packed(spans: Span[], tree: Tree): Lane[] {
  const lanes: Lane[] = [];
  const ends: number[] = [];
  const ran = new Set(spans.filter((span) => span.state === RUNNING).map((span) => `${span.uid} ${span.to}`));
  const items = shown(spans, tree, true)
    .filter(({ span, index }) => tree.nodes[index]!.category !== "condition"
      && (span.state === RUNNING || (span.state === FAILURE && !ran.has(`${span.uid} ${span.from}`))))
    .sort((a, b) => a.span.from - b.span.from);
  for (const item of items) {
    let at = ends.findIndex((end) => end <= item.span.from + 1e-6);
    if (at < 0) at = ends.length < MOST_PACKED ? ends.length : ends.indexOf(Math.min(...ends));
    ends[at] = item.span.to;
    (lanes[at] ??= { name: "", index: -1, spans: [] }).spans.push(item);
  }
  return lanes;
}
