// The log: filtered by level and words; a line leads to its node and its time.

import { useEffect, useRef } from "preact/hooks";
import { useSignal } from "@preact/signals";
import { seconds } from "../describe";
import { seek } from "../monitor";
import type { Run } from "../run";

const LEVELS = ["debug", "info", "warning", "error"];
const MOST_SHOWN = 400;
const AT_END = 24;

export function LogPanel({ run }: { run: Run }) {
  const least = useSignal("info");
  const filter = useSignal("");
  const box = useRef<HTMLDivElement>(null);
  const atEnd = useRef(true);
  const lines = run.log.value;
  const words = filter.value.toLowerCase();
  const tree = run.tree.value;
  const fitting = lines.filter(
    (line) => LEVELS.indexOf(line.level) >= LEVELS.indexOf(least.value)
      && `${line.message} ${line.node ?? ""} ${line.code ?? ""}`.toLowerCase().includes(words),
  );
  const shown = fitting.slice(-MOST_SHOWN);
  useEffect(() => {
    if (atEnd.current && box.current !== null) box.current.scrollTop = box.current.scrollHeight;
  });
  return (
    <div class="log">
      <div class="log-bar">
        <label class="unseen" for={`level-${run.id}`}>Least level</label>
        <select id={`level-${run.id}`} value={least.value} onChange={(event) => (least.value = event.currentTarget.value)}>
          {LEVELS.map((level) => <option key={level} value={level}>{level}</option>)}
        </select>
        <input
          type="text" class="filter" placeholder="Filter lines" aria-label="Filter lines" value={filter.value}
          onInput={(event) => (filter.value = event.currentTarget.value)}
        />
      </div>
      {shown.length < fitting.length && <p class="hint">The last {shown.length} of {fitting.length} lines.</p>}
      <div
        class="log-lines" ref={box} role="log" aria-live="off" aria-label="Log lines" tabIndex={0}
        onScroll={(event) => {
          const { scrollHeight, scrollTop, clientHeight } = event.currentTarget;
          atEnd.current = scrollHeight - scrollTop - clientHeight < AT_END;
        }}
      >
        {shown.length === 0 && <p class="empty">Nothing logged.</p>}
        {shown.map((line, i) => {
          const index = tree?.find(line.node) ?? -1;
          return (
            <div key={`${fitting.length - shown.length + i}`} class={`log-line ${line.level}`}>
              <button type="button" class="numbers time-link" title="Go to this moment" onClick={() => seek(run, line.time)}>
                {seconds(line.time)}
              </button>
              <span class="level">{line.level}</span>
              <span class="log-text">
                {index >= 0 && <button type="button" class="log-node" onClick={() => run.show(index)}>{tree!.nodes[index]!.name}</button>}
                {line.code && <code>{line.code}</code>} {line.message}
              </span>
            </div>
          );
        })}
      </div>
    </div>
  );
}
