// What buttons and keys do to an execution. Only what cannot be undone asks first; the emergency stop never asks.

import { control, isLive, readOnly, summary } from "./monitor";
import type { Breakpoint } from "./protocol";
import type { Run } from "./run";
import type { TreeNode } from "./tree";
import { question } from "./view_options";

/** What a control acts on: the ticks of the tree, one of its nodes, or the process with its robot and blackboard. */
export type Reach = "ticks" | "node" | "process";

/** Null when controls act on this run, else the reason why not. */
export function barred(run: Run, reach: Reach): string | null {
  if (readOnly.value) return "This monitor was started with --read-only";
  if (!isLive(run)) return "This run is over";
  const source = summary(run)?.source;
  if (source && (reach === "process" || (reach === "node" && source.startsWith("py_trees")))) {
    return `${source} is only watched: its own process has to do this`;
  }
  return null;
}

export function pauseOrResume(run: Run): void {
  void control(run, { do: run.paused.value === null ? "pause" : "resume" });
}

export function step(run: Run): void {
  void control(run, { do: "step" });
}

/** A motion that waits to be confirmed. */
export function startMotion(run: Run): void {
  void control(run, { do: "resume" }, "The motion starts");
}

export function declineMotion(run: Run): void {
  void control(run, { do: "decline" }, "The motion was declined");
}

/** Shares of the robot's speed to choose from. */
export const SPEEDS = [0.1, 0.3, 0.5, 0.75, 1];

export function setSpeed(run: Run, share: number): void {
  void control(run, { do: "speed", share }, `The robot moves at ${Math.round(100 * share)}% of its speed`).then((done) => {
    if (done) run.robot = { ...run.robot, speed: share }; // a paused run tells nothing new
    run.beat.value += 1;
  });
}

export function halt(run: Run): void {
  question.value = {
    title: "Halt this run?",
    text: "The tree is halted, all motion stops in an orderly way, and the run ends as cancelled. It cannot be resumed.",
    yes: "Halt the run",
    act: () => void control(run, { do: "halt" }, "Halted"),
  };
}

export function emergencyStop(run: Run): void {
  void control(run, { do: "stop" }, "Emergency stop: the robot was told to stop");
}

export function breakpointAt(run: Run, node: TreeNode, when: "before" | "after"): Breakpoint | undefined {
  return run.breakpoints.value.find((point) => point.node === node.uid && point.when === when);
}

export function toggleBreakpoint(run: Run, node: TreeNode, when: "before" | "after", condition = "", once = false): void {
  if (breakpointAt(run, node, when) !== undefined) void control(run, { do: "clear_breakpoint", node: node.uid, when });
  else void control(run, { do: "breakpoint", node: node.uid, when, condition: condition.trim() || null, once });
}

export function force(run: Run, node: TreeNode, result: "SUCCESS" | "FAILURE"): void {
  void control(run, { do: "force", node: node.uid, result }, `${node.name}: its next result will be ${result}`);
}

export function setEntry(run: Run, scope: string, key: string, value: string): Promise<boolean> {
  return control(run, { do: "set", key, value, scope }, `${key} was set`);
}
