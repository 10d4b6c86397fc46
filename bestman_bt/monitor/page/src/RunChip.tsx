// How a run stands, in a word, a shape and a colour.

import { BrokenShape, StateShape } from "./Icon";
import type { RunSummary } from "./protocol";
import { FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS } from "./states";

/** Without a state where the executor went away before the end. */
function look(run: RunSummary): [state: number | null, word: string] {
  switch (run.state) {
    case "running": return [RUNNING, "running"];
    case "paused": return [SKIPPED, "paused"];
    case "lost":
    case "interrupted": return [null, run.state];
    case "ended":
      if (run.outcome === "success") return [SUCCESS, "success"];
      return run.outcome ? [FAILURE, run.outcome] : [IDLE, "ended"];
  }
}

export function RunChip({ run }: { run: RunSummary }) {
  const [state, word] = look(run);
  const name = state === null ? "broken" : ["idle", "running", "success", "failure", "skipped"][state];
  return (
    <span class={`chip chip-${name}`} data-run-state={run.state}>
      {state === null ? <BrokenShape /> : <StateShape state={state} />}
      {word}
    </span>
  );
}
