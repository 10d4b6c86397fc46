// The state of the page: the connection, the list of runs, which one or two are shown, and what the person asked for.

import { batch, computed, effect, signal } from "@preact/signals";
import { Connection } from "./connection";
import { Run } from "./run";
import type { Control, Parted, RunSummary, ServerMessage } from "./protocol";

const TIMELINE_EVERY = 2000;
const NOTICE_TIME = 6000;

export const connected = signal(false);
export const everConnected = signal(false);
export const readOnly = signal(false);
export const runs = signal<RunSummary[]>([]);
/** The runs on the page: none, one, or two side by side. */
export const shown = signal<Run[]>([]);
/** Which of the shown runs the panels and keys speak of. */
export const focused = signal(0);
export const comparison = signal<{ parted: Parted | null; words: string } | null>(null);
export const notices = signal<{ key: number; text: string; kind: "good" | "bad" }[]>([]);

export const current = computed(() => shown.value[focused.value] ?? shown.value[0] ?? null);

export function summary(run: Run): RunSummary | undefined {
  return runs.value.find((candidate) => candidate.id === run.id);
}

const connection = new Connection(receive, (open) => {
  connected.value = open;
  if (open) everConnected.value = true;
});

let noticeKey = 0;

export function notify(text: string, kind: "good" | "bad"): void {
  const key = ++noticeKey;
  notices.value = [...notices.value.slice(-3), { key, text, kind }];
  window.setTimeout(() => dismiss(key), NOTICE_TIME);
}

export function dismiss(key: number): void {
  notices.value = notices.value.filter((notice) => notice.key !== key);
}

/** Shows one run, or two side by side. */
export function show(ids: string[]): void {
  const known = new Map(shown.peek().map((run) => [run.id, run]));
  for (const id of known.keys()) if (!ids.includes(id)) connection.send({ do: "close", id });
  batch(() => {
    shown.value = ids.map((id) => known.get(id) ?? new Run(id));
    focused.value = 0;
    comparison.value = null;
  });
  for (const id of ids) if (!known.has(id)) open(id);
  if (ids.length === 2) connection.send({ do: "compare", ids: [ids[0]!, ids[1]!] });
  history.replaceState(null, "", ids.length > 0 ? `#${ids.map(encodeURIComponent).join("&")}` : "#");
}

function open(id: string): void {
  connection.send({ do: "open", id });
  connection.send({ do: "timeline", id });
}

export function seek(run: Run, time: number): void {
  run.live.value = false;
  connection.send({ do: "seek", id: run.id, time: Math.max(run.first, Math.min(run.last, time)) });
}

export function goLive(run: Run): void {
  connection.send({ do: "live", id: run.id });
}

export function askSeries(run: Run, joints: string[]): void {
  connection.send({ do: "series", id: run.id, joints });
}

export function isLive(run: Run): boolean {
  const state = summary(run)?.state;
  return state === "running" || state === "paused";
}

/** Sends a control; what came of it is told in a notice. */
export async function control(run: Run, what: Control, done?: string): Promise<boolean> {
  try {
    await connection.control(run.id, what);
    if (done !== undefined) notify(done, "good");
    return true;
  } catch (error) {
    notify(`${what.do.replace("_", " ")}: ${(error as Error).message}`, "bad");
    return false;
  }
}

function receive(message: ServerMessage): void {
  switch (message.type) {
    case "hello":
      batch(() => {
        readOnly.value = message.read_only;
        takeRuns(message.runs);
      });
      reopen();
      return;
    case "runs":
      takeRuns(message.runs);
      if (shown.peek().length === 0) openFirst();
      return;
    case "comparison":
      comparison.value = message;
      return;
    case "problem":
      notify(message.message, "bad");
      return;
    case "answer":
      return;
  }
  const run = shown.peek().find((candidate) => candidate.id === message.id);
  if (run === undefined) return;
  batch(() => {
    switch (message.type) {
      case "tree": run.takeTree(message); break;
      case "map": run.map.value = message; break;
      case "state": run.takeState(message); break;
      case "delta": run.takeDelta(message); break;
      case "log": run.takeLog(message.lines, message.reset ?? false); break;
      case "extent": run.takeExtent(message.first, message.last); break;
      case "image": run.takePicture(message); break;
      case "series": run.joints.replace(message.joints); run.beat.value++; break;
      case "timeline":
        run.takeTimeline(message.first, message.last, message.spans, message.marks);
        begin(run);
        break;
    }
  });
}

/** Runs that are over are opened where they tell most; one that ends while it is looked at stays where it is. */
function begin(run: Run): void {
  if (run.opened) return;
  run.opened = true;
  if (!isLive(run)) seek(run, run.telling);
}

function takeRuns(list: RunSummary[]): void {
  runs.value = list;
  const ids = shown.peek().map((run) => successor(run)?.id ?? run.id);
  if (ids.some((id, place) => shown.peek()[place]?.id !== id)) show([...new Set(ids)]);
}

/** A process that is only watched and begins anew is another run: who looks at its present goes on with that one. */
function successor(run: Run): RunSummary | undefined {
  const info = summary(run);
  if (!info?.source || isLive(run) || !run.live.peek()) return undefined;
  return runs.peek().find((other) => other.source === info.source && other.state === "running" && (other.started ?? 0) > (info.started ?? 0));
}

function reopen(): void {
  if (shown.peek().length === 0) {
    const asked = location.hash.slice(1).split("&").filter(Boolean).map(decodeURIComponent);
    const there = asked.filter((id) => runs.peek().some((run) => run.id === id));
    if (there.length > 0) show(there.slice(0, 2));
    else openFirst();
    return;
  }
  shown.peek().forEach((run) => open(run.id));
  const [a, b] = shown.peek();
  if (a !== undefined && b !== undefined) connection.send({ do: "compare", ids: [a.id, b.id] });
}

/** A run that goes on is what one came for; where there are only old ones, one of them is opened if it is the only one. */
function openFirst(): void {
  const going = runs.peek().find((run) => run.kind === "live" && run.state !== "ended" && run.state !== "lost");
  const only = runs.peek().length === 1 ? runs.peek()[0] : undefined;
  const first = going ?? only;
  if (first !== undefined) show([first.id]);
}

/** Once, at the start of the page. */
export function start(): void {
  connection.connect();
  window.setInterval(() => {
    for (const run of shown.peek()) if (isLive(run)) connection.send({ do: "timeline", id: run.id });
  }, TIMELINE_EVERY);
  effect(() => {
    const run = current.value;
    const info = run === null ? undefined : summary(run);
    document.title = info === undefined ? "bestman-bt monitor" : `${info.task ?? info.tree ?? info.id} · ${info.state} · bestman-bt`;
  });
}
