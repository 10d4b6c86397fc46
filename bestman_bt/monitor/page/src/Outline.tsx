// The tree as rows of text: the form for narrow screens and for readers. Only the rows in view exist.

import { useEffect, useRef, useState } from "preact/hooks";
import { useSignalEffect } from "@preact/signals";
import { describe } from "./describe";
import { Icon, StateShape } from "./Icon";
import type { Run } from "./run";
import { kindSign, RUNNING } from "./states";
import { following, form, searching } from "./view_options";
import { walk } from "./walk";

const ROW = 30;
const SPARE = 6;

export function Outline({ run }: { run: Run }) {
  const host = useRef<HTMLDivElement>(null);
  const [scroll, setScroll] = useState({ top: 0, height: 600 });
  const tree = run.tree.value;
  const rows = tree?.rows(run.collapsed.value) ?? [];
  const selected = run.selected.value;
  void run.beat.value;

  const reveal = (index: number): void => {
    const row = run.tree.peek()?.rows(run.collapsed.peek()).indexOf(index) ?? -1;
    const box = host.current;
    if (row < 0 || box === null) return;
    if (row * ROW < box.scrollTop + ROW) box.scrollTop = row * ROW - ROW;
    else if ((row + 2) * ROW > box.scrollTop + box.clientHeight) box.scrollTop = (row + 2) * ROW - box.clientHeight;
  };
  useEffect(() => {
    const watching = new ResizeObserver(([entry]) => setScroll((now) => ({ ...now, height: entry!.contentRect.height })));
    watching.observe(host.current!);
    return () => watching.disconnect();
  }, []);
  useSignalEffect(() => reveal(run.selected.value));
  useSignalEffect(() => {
    void run.beat.value;
    const leaf = following.value ? run.runningLeaves()[0] : undefined;
    if (leaf !== undefined) reveal(leaf);
  });

  const found = new Set(tree?.search(searching.value) ?? []);
  const first = Math.max(0, Math.floor(scroll.top / ROW) - SPARE);
  const shown = rows.slice(first, Math.ceil((scroll.top + scroll.height) / ROW) + SPARE);
  if (selected >= 0 && rows.includes(selected) && !shown.includes(selected)) shown.push(selected);
  const stops = new Set(run.breakpoints.value.map((point) => tree?.indexOf(point.node)));

  return (
    <div class="outline">
      <div
        class="outline-host" ref={host} role="tree" tabIndex={0} aria-label="Behavior tree, as an outline"
        aria-activedescendant={selected >= 0 ? `row-${run.id}-${selected}` : undefined}
        onScroll={(event) => {
          const top = event.currentTarget.scrollTop;
          setScroll((now) => ({ ...now, top }));
        }}
        onWheel={() => (following.value = false)}
        onKeyDown={(event) => {
          if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || !walk(run, event.key)) return;
          event.preventDefault();
          event.stopPropagation();
        }}
      >
        <div class="outline-rows" role="presentation" style={{ height: `${rows.length * ROW}px` }}>
          {tree !== null && shown.map((index) => {
            const node = tree.nodes[index]!;
            const state = run.states[index]!;
            const folded = run.collapsed.value.has(index);
            const siblings = tree.nodes[node.parentIndex]?.children ?? [index];
            return (
              <div
                key={index} role="treeitem" id={`row-${run.id}-${index}`} data-state={state} data-uid={node.uid}
                class={`outline-row${state === RUNNING ? " runs" : ""}${found.has(index) ? " found" : ""}`}
                aria-level={node.depth + 1} aria-selected={index === selected} aria-label={describe(run, node)}
                aria-posinset={siblings.indexOf(index) + 1} aria-setsize={siblings.length}
                aria-expanded={node.children.length > 0 ? !folded : undefined}
                style={{ top: `${rows.indexOf(index) * ROW}px`, paddingLeft: `${8 + Math.min(node.depth, 14) * 13}px` }}
                onClick={() => {
                  run.selected.value = index;
                  host.current?.focus();
                }}
                onDblClick={() => run.fold(index, !folded)}
              >
                <span class={`twist${node.children.length > 0 ? "" : " leaf"}`} onClick={(event) => {
                  event.stopPropagation();
                  run.fold(index, !folded);
                }}>
                  {node.children.length > 0 && <Icon name={folded ? "right" : "down"} />}
                </span>
                <StateShape state={run.shownState(index)} faint={run.isFaint(index)} />
                <span class="row-name">{node.name}</span>
                {node.type !== node.name && <span class="row-type">{kindSign(node.type, node.category)} {node.type}</span>}
                {folded && node.size > 0 && <span class="badge">+{node.size}</span>}
                {stops.has(index) && <span class="stop-dot" title="Breakpoint" />}
              </div>
            );
          })}
        </div>
      </div>
      <div class="graph-tools" role="toolbar" aria-label="Outline of the tree">
        <button type="button" class="tool" aria-label="Follow what runs (W)" title="Follow what runs (W)" aria-pressed={following.value} onClick={() => (following.value = !following.value)}>
          <Icon name="follow" />
        </button>
        <button type="button" class="tool" aria-label="As a drawing (O)" title="As a drawing (O)" onClick={() => (form.value = "drawing")}>
          <Icon name="drawing" />
        </button>
      </div>
    </div>
  );
}
