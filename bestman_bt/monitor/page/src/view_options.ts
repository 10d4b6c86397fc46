// How the person wants the tree shown; kept from visit to visit.

import { effect, signal } from "@preact/signals";
import type { Orientation } from "./graph/layout";

export type TreeForm = "drawing" | "outline";
export type Panel = "node" | "blackboard" | "robot" | "log";

export const PANELS: { id: Panel; title: string; key: string }[] = [
  { id: "node", title: "Node", key: "1" },
  { id: "blackboard", title: "Blackboard", key: "2" },
  { id: "robot", title: "Robot", key: "3" },
  { id: "log", title: "Log", key: "4" },
];

interface Kept {
  form: TreeForm;
  orientation: Orientation;
  panel: Panel;
  tallTimeline: boolean;
}

const KEY = "bestman-bt-view";

function kept(): Partial<Kept> {
  try {
    return JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Kept>;
  } catch {
    return {};
  }
}

const before = kept();
const narrow = matchMedia("(max-width: 719px)").matches;

export const form = signal<TreeForm>(before.form ?? (narrow ? "outline" : "drawing"));
export const orientation = signal<Orientation>(before.orientation ?? "right");
export const panel = signal<Panel>(before.panel ?? "node");
/** On a phone the tree is one of the tabs. */
export const phoneTree = signal(true);
export const tallTimeline = signal(before.tallTimeline ?? false);
export const following = signal(true);
export const searching = signal("");
export const helpOpen = signal(false);
export const pickerOpen = signal(false);
/** What waits for a "yes". */
export const question = signal<{ title: string; text: string; yes: string; act: () => void } | null>(null);

effect(() => {
  const keep: Kept = {
    form: form.value, orientation: orientation.value, panel: panel.value, tallTimeline: tallTimeline.value,
  };
  localStorage.setItem(KEY, JSON.stringify(keep));
});

export function openPanel(id: Panel): void {
  panel.value = id;
  phoneTree.value = false;
}
