// The dialogs of the page: all runs, the keys, and the question before what cannot be undone.

import { useSignal } from "@preact/signals";
import { calendar, seconds } from "./describe";
import { Dialog } from "./Dialog";
import { Icon } from "./Icon";
import { KEYS, TREE_KEYS } from "./keyboard";
import { dismiss, notices, runs, show, shown } from "./monitor";
import type { RunSummary } from "./protocol";
import { RunChip } from "./RunChip";
import { helpOpen, pickerOpen, question } from "./view_options";

const MOST_LISTED = 200;

export function Dialogs() {
  const asked = question.value;
  return (
    <>
      <Dialog open={pickerOpen.value} title="Runs" close={() => (pickerOpen.value = false)} wide><Runs /></Dialog>
      <Dialog open={helpOpen.value} title="Keys" close={() => (helpOpen.value = false)} wide><Keys /></Dialog>
      <Dialog open={asked !== null} title={asked?.title ?? ""} close={() => (question.value = null)}>
        <p>{asked?.text}</p>
        <div class="buttons end">
          <button type="button" class="button" onClick={() => (question.value = null)}>Leave it running</button>
          <button type="button" class="button danger" onClick={() => {
            question.value = null;
            asked?.act();
          }}>{asked?.yes}</button>
        </div>
      </Dialog>
      <div class="notices" role="status" aria-live="polite">
        {notices.value.map((notice) => (
          <div key={notice.key} class={`notice ${notice.kind}`}>
            <Icon name={notice.kind === "good" ? "check" : "stop"} />
            <span>{notice.text}</span>
            <button type="button" class="tool" aria-label="Dismiss" onClick={() => dismiss(notice.key)}><Icon name="close" /></button>
          </div>
        ))}
      </div>
    </>
  );
}

function Runs() {
  const words = useSignal("");
  const fits = (run: RunSummary): boolean =>
    `${run.task} ${run.tree} ${run.source} ${run.robot} ${run.scene} ${run.seed} ${run.state} ${run.outcome} ${run.folder}`.toLowerCase().includes(words.value.toLowerCase());
  const fitting = runs.value.filter(fits);
  const going = fitting.filter((run) => run.kind === "live");
  const recorded = fitting.filter((run) => run.kind === "recorded");
  return (
    <>
      <input type="text" class="filter" placeholder="Filter by task, robot, scene, seed, outcome" aria-label="Filter runs" value={words.value} onInput={(event) => (words.value = event.currentTarget.value)} />
      {runs.value.length === 0 && (
        <p class="empty">Nothing runs on this machine. Start one with <code>bestman-bt run TREE --monitor</code>, or open finished ones with <code>bestman-bt monitor RUN_FOLDER…</code></p>
      )}
      <List title="Executors of this machine" list={going} />
      <List title="Run folders" list={recorded} />
    </>
  );
}

function List({ title, list }: { title: string; list: RunSummary[] }) {
  if (list.length === 0) return null;
  return (
    <>
      <h3>{title} <span class="badge">{list.length}</span></h3>
      <ul class="run-list">{list.slice(0, MOST_LISTED).map((run) => <Line key={run.id} run={run} />)}</ul>
    </>
  );
}

function Line({ run }: { run: RunSummary }) {
  const ids = shown.value.map((other) => other.id);
  const open = ids.includes(run.id);
  const choose = (wanted: string[]): void => {
    show(wanted);
    pickerOpen.value = false;
  };
  return (
    <li class={open ? "open" : undefined}>
      <button type="button" class="run-line" aria-current={open ? "true" : undefined} onClick={() => choose([run.id])}>
        <RunChip run={run} />
        <strong>{run.task ?? run.tree ?? run.id}</strong>
        <span class="run-details">
          {[run.source, run.robot, run.scene, run.source || run.seed === null || run.seed === undefined ? null : `seed ${run.seed}`].filter(Boolean).join(" · ")}
          {run.folder && <span class="run-folder" title={run.folder}>{run.folder.split("/").findLast(Boolean)}</span>}
        </span>
        <span class="numbers run-when">{[run.time ? seconds(run.time) : null, run.started ? calendar(run.started) : null].filter(Boolean).join(", ")}</span>
      </button>
      {ids.length > 0 && !open && (
        <button type="button" class="button" aria-label={`Compare with ${run.task ?? run.id}, seed ${run.seed ?? "unknown"}`} onClick={() => choose([ids[0]!, run.id])}>
          <Icon name="compare" /> Beside
        </button>
      )}
    </li>
  );
}

function Keys() {
  return (
    <div class="keys">
      <Table title="Everywhere" rows={KEYS.map(({ label, words }) => [label, words])} />
      <Table title="In the tree" rows={TREE_KEYS} />
    </div>
  );
}

function Table({ title, rows }: { title: string; rows: [string, string][] }) {
  return (
    <section>
      <h3>{title}</h3>
      <dl>{rows.map(([key, words]) => <div key={key}><dt><kbd>{key}</kbd></dt><dd>{words}</dd></div>)}</dl>
    </section>
  );
}
