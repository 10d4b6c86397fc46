// Every key of the page in one table, which the help lists too.

import { barred, type Reach, emergencyStop, halt, pauseOrResume, step, toggleBreakpoint } from "./actions";
import { current, focused, goLive, isLive, seek, shown } from "./monitor";
import { turnTheme } from "./theme";
import type { Run } from "./run";
import { following, form, helpOpen, openPanel, orientation, PANELS, phoneTree, pickerOpen, tallTimeline } from "./view_options";

interface Key {
  keys: string[];
  label: string;
  words: string;
  /** Controls act on the execution and are off where it cannot be controlled. */
  controls?: Reach;
  act: (run: Run) => void;
}

function byMark(run: Run, way: 1 | -1): void {
  const times = run.timeline.value.marks.map((mark) => mark.time).sort((a, b) => a - b);
  const slack = 1e-3;
  const next = way > 0 ? times.find((time) => time > run.time + slack) : times.findLast((time) => time < run.time - slack);
  if (next !== undefined) seek(run, next);
}

function breakHere(run: Run): void {
  const node = run.tree.value?.nodes[run.selected.value];
  if (node !== undefined) toggleBreakpoint(run, node, "before");
}

export const KEYS: Key[] = [
  { keys: ["X"], label: "Shift X", words: "Emergency stop", controls: "process", act: emergencyStop },
  { keys: [" "], label: "Space", words: "Pause or resume", controls: "ticks", act: pauseOrResume },
  { keys: ["n"], label: "N", words: "One tick", controls: "ticks", act: step },
  { keys: ["H"], label: "Shift H", words: "Halt the run (asks first)", controls: "process", act: halt },
  { keys: ["b"], label: "B", words: "Breakpoint before the chosen node", controls: "node", act: breakHere },
  { keys: [","], label: ",", words: "Back by one second", act: (run) => seek(run, run.time - 1) },
  { keys: ["."], label: ".", words: "On by one second", act: (run) => seek(run, run.time + 1) },
  { keys: ["["], label: "[", words: "Previous mark of the timeline", act: (run) => byMark(run, -1) },
  { keys: ["]"], label: "]", words: "Next mark of the timeline", act: (run) => byMark(run, 1) },
  { keys: ["l"], label: "L", words: "Back to live", act: (run) => isLive(run) && goLive(run) },
  { keys: ["/"], label: "/", words: "Search a node", act: () => focusOn("search") },
  { keys: ["g"], label: "G", words: "To the tree", act: () => focusOn("tree") },
  { keys: ["w"], label: "W", words: "Follow what runs", act: () => (following.value = !following.value) },
  { keys: ["o"], label: "O", words: "Drawing or outline", act: () => (form.value = form.value === "outline" ? "drawing" : "outline") },
  { keys: ["d"], label: "D", words: "Turn the drawing", act: () => (orientation.value = orientation.value === "right" ? "down" : "right") },
  { keys: ["e"], label: "E", words: "Unfold all", act: (run) => (run.collapsed.value = new Set()) },
  { keys: ["q"], label: "Q", words: "Fold subtrees", act: (run) => (run.collapsed.value = run.tree.value?.folded(60) ?? new Set()) },
  ...PANELS.map(({ id, title, key }) => ({ keys: [key], label: key, words: `Panel: ${title}`, act: () => openPanel(id) })),
  { keys: ["m"], label: "M", words: "Timeline: tall or slim", act: () => (tallTimeline.value = !tallTimeline.value) },
  { keys: ["r"], label: "R", words: "All runs", act: () => (pickerOpen.value = true) },
  { keys: ["s"], label: "S", words: "The other run of two", act: () => (focused.value = shown.value.length - 1 - focused.value) },
  { keys: ["t"], label: "T", words: "Dark or light", act: turnTheme },
  { keys: ["?"], label: "?", words: "This list", act: () => (helpOpen.value = true) },
];

/** Keys that the focused tree answers itself. */
export const TREE_KEYS: [string, string][] = [
  ["← ↑ ↓ →", "Walk the tree; ← folds, → unfolds"],
  ["Enter", "Fold or unfold"],
  ["F", "Show the whole tree"],
  ["+ −", "Zoom"],
  ["Shift + arrows", "Move the drawing"],
];

function focusOn(what: "search" | "tree"): void {
  phoneTree.value = true;
  requestAnimationFrame(() => document.querySelector<HTMLElement>(what === "search" ? "input[type=search]" : "[role=tree]")?.focus());
}

export function startKeyboard(): void {
  document.addEventListener("keydown", (event) => {
    const at = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") !== null) return;
    if (at.closest("input, textarea, select") !== null) {
      if (event.key === "Escape") at.blur();
      return;
    }
    const key = KEYS.find((candidate) => candidate.keys.includes(event.key));
    const run = current.value;
    if (key === undefined || (event.key === " " && at.closest("button, summary, [role=tab]") !== null)) return;
    const free = ["r", "t", "?"].includes(event.key);
    if (run === null && !free) return;
    event.preventDefault();
    if (run !== null && key.controls && barred(run, key.controls) !== null) return;
    key.act(run!);
  });
}
