// The tree of one run with its search; in a comparison there are two of these.

import { useRef } from "preact/hooks";
import { Icon } from "./Icon";
import { focused, shown, summary } from "./monitor";
import { Outline } from "./Outline";
import type { Run } from "./run";
import { seconds } from "./describe";
import { RunChip } from "./RunChip";
import { TreeGraph } from "./graph/TreeGraph";
import { following, form, searching } from "./view_options";

export function TreePane({ run, place }: { run: Run; place: number }) {
  const at = useRef(-1);
  const two = shown.value.length > 1;
  const info = summary(run);
  const tree = run.tree.value;
  const found = tree?.search(searching.value) ?? [];
  const next = (way: number): void => {
    if (found.length === 0) return;
    at.current = (at.current + way + found.length) % found.length;
    following.value = false; // else what runs would take the view away from what was found
    run.show(found[at.current]!);
  };
  return (
    <section
      class={`tree-pane${two && focused.value === place ? " focused" : ""}`}
      aria-label={two ? `Run ${place === 0 ? "A" : "B"}` : "Tree"} onPointerDownCapture={() => (focused.value = place)}
      onFocusCapture={() => (focused.value = place)}
    >
      <div class="tree-bar">
        {two ? (
          <>
            <span class="letter">{place === 0 ? "A" : "B"}</span>
            <span class="tree-title">{info?.task ?? info?.tree ?? run.id}</span>
            {info !== undefined && <RunChip run={info} />}
            <Clock run={run} />
          </>
        ) : (
          <h2 class="tree-title">{info?.tree ?? info?.task ?? "Tree"}</h2>
        )}
        {place === 0 && (
          <label class="search">
            <Icon name="search" />
            <input
              type="search" placeholder="Search nodes" aria-label="Search nodes" value={searching.value}
              onInput={(event) => {
                searching.value = event.currentTarget.value;
                at.current = -1;
              }}
              onKeyDown={(event) => {
                if (event.key === "Enter") next(event.shiftKey ? -1 : 1);
              }}
            />
            <span class="found-count" role="status">{searching.value !== "" && `${found.length} found`}</span>
          </label>
        )}
        {tree !== null && <span class="node-count">{tree.nodes.length} nodes</span>}
      </div>
      {tree === null ? <p class="empty">Waiting for the tree…</p> : form.value === "outline" ? <Outline run={run} /> : <TreeGraph run={run} />}
    </section>
  );
}

function Clock({ run }: { run: Run }) {
  void run.beat.value;
  return <span class="numbers">{seconds(run.time)}</span>;
}
