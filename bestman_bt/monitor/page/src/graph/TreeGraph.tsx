// The drawing with its tools. Beside the canvas lie real tree items for the chosen node and its kin, for keyboards and readers.

import { useEffect, useMemo, useRef } from "preact/hooks";
import { useSignalEffect } from "@preact/signals";
import { describe } from "../describe";
import { Icon } from "../Icon";
import { shown } from "../monitor";
import type { Run } from "../run";
import { palette } from "../theme";
import type { Tree } from "../tree";
import { walk } from "../walk";
import { following, form, orientation, searching } from "../view_options";
import { GraphView } from "./view";

const PAN_STEP = 80;

export function TreeGraph({ run }: { run: Run }) {
  const host = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const map = useRef<HTMLCanvasElement>(null);
  const view = useRef<GraphView | null>(null);

  useEffect(() => {
    const box = host.current!;
    const marker = (): HTMLElement | null => box.querySelector("[aria-selected=true]");
    const made = new GraphView(run, box, canvas.current!, map.current!, marker, () => (following.value = false), () => shown.peek().length > 1);
    view.current = made;
    return () => {
      made.close();
      view.current = null;
    };
  }, [run]);

  useSignalEffect(() => {
    void [run.tree.value, run.collapsed.value];
    view.current?.relayout(orientation.value);
  });
  useSignalEffect(() => {
    void [run.frame.value, palette.value, run.breakpoints.value, run.paused.value];
    if (view.current === null) return;
    view.current.following = following.value;
    view.current.follow();
    view.current.redraw();
  });
  useSignalEffect(() => {
    if (run.selected.value >= 0) view.current?.reveal(run.selected.value);
    else view.current?.redraw();
  });
  useSignalEffect(() => {
    if (view.current === null) return;
    view.current.found = new Set(run.tree.value?.search(searching.value) ?? []);
    view.current.redraw();
  });

  const tree = run.tree.value;
  const selected = run.selected.value;
  void run.beat.value;
  const keys = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.shiftKey && event.key.startsWith("Arrow")) {
      const x = event.key === "ArrowLeft" ? PAN_STEP : event.key === "ArrowRight" ? -PAN_STEP : 0;
      const y = event.key === "ArrowUp" ? PAN_STEP : event.key === "ArrowDown" ? -PAN_STEP : 0;
      following.value = false;
      view.current?.panBy(x, y);
    } else if (event.key === "+" || event.key === "=") view.current?.zoom(1.25);
    else if (event.key === "-") view.current?.zoom(0.8);
    else if (event.key === "f") view.current?.fit();
    else if (!walk(run, event.key)) return;
    event.preventDefault();
    event.stopPropagation();
  };
  const kin = useMemo(() => (tree === null ? [] : around(tree, Math.max(0, selected))), [tree, selected]);

  return (
    <div class="graph">
      <div
        class="graph-host" ref={host} tabIndex={0} role="tree" aria-label="Behavior tree, drawn" onKeyDown={keys}
        aria-activedescendant={tree === null ? undefined : `item-${run.id}-${Math.max(0, selected)}`}
      >
        <canvas ref={canvas} aria-hidden="true" />
        {tree !== null && kin.map((index) => <Item key={index} run={run} tree={tree} index={index} chosen={index === Math.max(0, selected)} />)}
      </div>
      <canvas class="minimap" ref={map} aria-hidden="true" hidden />
      <div class="graph-tools" role="toolbar" aria-label="Drawing of the tree">
        <Tool icon="plus" name="Zoom in" onClick={() => view.current?.zoom(1.25)} />
        <Tool icon="minus" name="Zoom out" onClick={() => view.current?.zoom(0.8)} />
        <Tool icon="fit" name="Show the whole tree (F)" onClick={() => view.current?.fit()} />
        <Tool icon="follow" name="Follow what runs (W)" pressed={following.value} onClick={() => (following.value = !following.value)} />
        <Tool
          icon="turn" name="Turn the drawing (D)"
          onClick={() => (orientation.value = orientation.value === "right" ? "down" : "right")}
        />
        <Tool icon="unfold" name="Unfold all (E)" onClick={() => (run.collapsed.value = new Set())} />
        <Tool icon="fold" name="Fold subtrees (Q)" onClick={() => (run.collapsed.value = run.tree.value?.folded(60) ?? new Set())} />
        <Tool icon="outline" name="As an outline (O)" onClick={() => (form.value = "outline")} />
      </div>
    </div>
  );
}

function Tool({ icon, name, pressed, onClick }: { icon: string; name: string; pressed?: boolean; onClick: () => void }) {
  return (
    <button type="button" class="tool" aria-label={name} title={name} aria-pressed={pressed} onClick={onClick}>
      <Icon name={icon} />
    </button>
  );
}

function Item({ run, tree, index, chosen }: { run: Run; tree: Tree; index: number; chosen: boolean }) {
  const node = tree.nodes[index]!;
  const siblings = tree.nodes[node.parentIndex]?.children ?? [index];
  return (
    <div
      role="treeitem" class="graph-item" id={`item-${run.id}-${index}`} data-index={index}
      data-state={run.states[index]} aria-selected={chosen} aria-level={node.depth + 1}
      aria-posinset={siblings.indexOf(index) + 1} aria-setsize={siblings.length}
      aria-expanded={node.children.length > 0 ? !run.collapsed.value.has(index) : undefined}
      aria-label={describe(run, node)}
    />
  );
}

/** Ancestors, siblings and children: what arrow keys reach from here. */
function around(tree: Tree, index: number): number[] {
  const node = tree.nodes[index];
  if (node === undefined) return [];
  const near = new Set([index, ...tree.ancestors(index), ...node.children.slice(0, 50)]);
  tree.nodes[node.parentIndex]?.children.slice(0, 50).forEach((sibling) => near.add(sibling));
  return [...near].sort((a, b) => a - b);
}
