// Spans into lanes: one lane a node when there is room, else as few lanes as hold them without overlap.

import type { Span } from "../protocol";
import { FAILURE, IDLE, RUNNING } from "../states";
import type { Tree } from "../tree";

export interface Lane {
  name: string;
  index: number;
  spans: Piece[];
}

/** `worked`: whether the node was at work; else it stands at a result. `shown`: how the work ended; IDLE where it was halted. */
export interface Piece {
  span: Span;
  index: number;
  worked: boolean;
  shown: number;
}

const MOST_PACKED = 3;

/** What work came to is the state that the node took when it ended; `last`: until when spans go on in a run that is not over. */
function pieces(spans: Span[], tree: Tree, last: number, over: boolean): Piece[] {
  const next = new Map(spans.map((span) => [`${span.uid} ${span.from}`, span.state]));
  const ended = (span: Span): number => next.get(`${span.uid} ${span.to}`) ?? (!over && span.to >= last - 1e-3 ? RUNNING : IDLE);
  return spans.map((span) => {
    const index = tree.indexOf(span.uid);
    if (span.merged) return { span, index, worked: true, shown: span.state };
    const worked = span.state === RUNNING;
    return { span, index, worked, shown: worked ? ended(span) : span.state };
  });
}

function shown(all: Piece[], tree: Tree, leavesOnly: boolean): Piece[] {
  return all
    .filter(({ index }) => index >= 0 && (!leavesOnly || tree.nodes[index]!.children.length === 0));
}

/** A lane for each node, in drawing order. */
export function laneByNode(spans: Span[], tree: Tree, last: number, over: boolean): Lane[] {
  const lanes = new Map<number, Lane>();
  for (const item of shown(pieces(spans, tree, last, over), tree, false)) {
    const lane = lanes.get(item.index) ?? { name: tree.nodes[item.index]!.name, index: item.index, spans: [] };
    lane.spans.push(item);
    lanes.set(item.index, lane);
  }
  return [...lanes.values()].sort((a, b) => a.index - b.index);
}

/** Only what leaves did, first come first placed; a failure shows where a long history was merged into it. */
export function packed(spans: Span[], tree: Tree, last: number, over: boolean): Lane[] {
  const lanes: Lane[] = [];
  const ends: number[] = [];
  const ran = new Set(spans.filter((span) => span.state === RUNNING).map((span) => `${span.uid} ${span.to}`));
  const items = shown(pieces(spans, tree, last, over), tree, true)
    .filter(({ span, index, worked }) => tree.nodes[index]!.category !== "condition"
      && (worked || (span.state === FAILURE && !ran.has(`${span.uid} ${span.from}`))))
    .sort((a, b) => a.span.from - b.span.from);
  for (const item of items) {
    let at = ends.findIndex((end) => end <= item.span.from + 1e-6);
    if (at < 0) at = ends.length < MOST_PACKED ? ends.length : ends.indexOf(Math.min(...ends));
    ends[at] = item.span.to;
    (lanes[at] ??= { name: "", index: -1, spans: [] }).spans.push(item);
  }
  return lanes;
}
