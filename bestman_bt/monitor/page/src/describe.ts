// Nodes and times in words.

import type { Entry } from "./protocol";
import type { Run } from "./run";
import { stateName } from "./states";
import type { TreeNode } from "./tree";

/** What a screen reader says of a node. */
export function describe(run: Run, node: TreeNode): string {
  const why = run.messages.get(node.index);
  const stopped = run.breakpoints.value.some((point) => run.tree.value?.indexOf(point.node) === node.index);
  return [
    `${node.name}, ${node.type}, ${stateInWords(run, node.index)}`,
    stopped ? "breakpoint" : "",
    why ?? "",
  ].filter(Boolean).join("; ");
}

/** A node that was reset after it returned is idle, but what it returned is what one wants to know. */
export function stateInWords(run: Run, index: number): string {
  const name = stateName(run.states[index] ?? 0);
  return run.isFaint(index) ? `${name}, last ${stateName(run.results[index]!)}` : name;
}

export function seconds(time: number): string {
  if (!Number.isFinite(time)) return "–";
  const sign = time < 0 ? "−" : "";
  const whole = Math.abs(time);
  if (whole < 60) return `${sign}${whole.toFixed(1)} s`;
  const minutes = Math.floor(whole / 60);
  const rest = (whole - minutes * 60).toFixed(1).padStart(4, "0");
  return minutes < 60 ? `${sign}${minutes}:${rest}` : `${sign}${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${rest}`;
}

/** An empty text is told apart from an entry that has no value. */
export function shownText(entry: Entry): string {
  if (entry.text !== "") return entry.text;
  return entry.value === "" ? '""' : "none";
}

/** A moment by calendar and clock, as folders of runs are named. */
export function calendar(epoch: number): string {
  const date = new Date(epoch * 1000);
  const two = (number: number): string => String(number).padStart(2, "0");
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day} ${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}
