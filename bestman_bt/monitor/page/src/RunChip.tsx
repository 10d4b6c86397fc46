// How a run stands, in a word, a shape and a colour.

import { StateShape } from "./Icon";
import type { RunSummary } from "./protocol";
import { FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS } from "./states";

function look(run: RunSummary): [state: number, word: string] {
  switch (run.state) {
    case "running": return [RUNNING, "running"];
    case "paused": return [SKIPPED, "paused"];
    case "lost": return [FAILURE, "lost"];
    case "interrupted": return [FAILURE, "interrupted"];
    case "ended":
      if (run.outcome === "success") return [SUCCESS, "success"];
      return run.outcome ? [FAILURE, run.outcome] : [IDLE, "ended"];
  }
}

export function RunChip({ run }: { run: RunSummary }) {
  const [state, word] = look(run);
  return (
    <span class={`chip chip-${["idle", "running", "success", "failure", "skipped"][state]}`} data-run-state={run.state}>
      <StateShape state={state} />
      {word}
    </span>
  );
}
