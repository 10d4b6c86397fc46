// Nodes and times in words.

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

export function ago(epoch: number): string {
  const passed = Date.now() / 1000 - epoch;
  if (passed < 90) return "just now";
  if (passed < 5400) return `${Math.round(passed / 60)} min ago`;
  if (passed < 129600) return `${Math.round(passed / 3600)} h ago`;
  return new Date(epoch * 1000).toLocaleDateString();
}
