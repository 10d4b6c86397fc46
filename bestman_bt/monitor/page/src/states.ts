// The engine's five states, and NO, by which the server tells that a condition does not hold: each has a name, a letter and a shape beside its colour, so that no one needs to tell hues apart.

export const IDLE = 0;
export const RUNNING = 1;
export const SUCCESS = 2;
export const FAILURE = 3;
export const SKIPPED = 4;
export const NO = 5;

export const STATE_NAMES = ["IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED", "NO"] as const;

export function stateName(state: number | string): string {
  return typeof state === "string" ? state : (STATE_NAMES[state] ?? "IDLE");
}

/** SVG paths on a 16 x 16 field: the outer shape, and the sign cut into it. */
export const STATE_SHAPES: readonly { shape: string; sign: string }[] = [
  { shape: "M8 3.2a4.8 4.8 0 1 0 .01 0z", sign: "" },
  { shape: "M3.2 1.9 14.4 8 3.2 14.1z", sign: "" },
  { shape: "M8 1a7 7 0 1 0 .01 0z", sign: "M4.7 8.2 7.1 10.6 11.4 5.7" },
  { shape: "M2.5 1.5h11a1 1 0 0 1 1 1v11a1 1 0 0 1-1 1h-11a1 1 0 0 1-1-1v-11a1 1 0 0 1 1-1z", sign: "M5.2 5.2l5.6 5.6M10.8 5.2l-5.6 5.6" },
  { shape: "M8 .8 15.2 8 8 15.2.8 8z", sign: "M5.3 8h5.4" },
  { shape: "M4.5 4h7a4 4 0 0 1 0 8h-7a4 4 0 0 1 0-8z", sign: "M5.3 8h5.4" },
];

const CONTROL_SIGNS: Record<string, string> = {
  Sequence: "→",
  SequenceWithMemory: "→",
  ReactiveSequence: "⇢",
  AsyncSequence: "→",
  Fallback: "?",
  ReactiveFallback: "?",
  AsyncFallback: "?",
  Parallel: "⇉",
  ParallelAll: "⇉",
  Inverter: "¬",
  RetryUntilSuccessful: "↻",
  Repeat: "↻",
  KeepRunningUntilFailure: "↻",
  Delay: "◷",
  Timeout: "◷",
  RateController: "◷",
  ForceSuccess: "✓",
  ForceFailure: "✗",
};

const CATEGORY_SIGNS: Record<string, string> = {
  action: "▸",
  condition: "◦",
  control: "◆",
  decorator: "◇",
  subtree: "⊞",
};

/** The sign by which the literature draws a node of this kind. */
export function kindSign(type: string, category: string): string {
  return CONTROL_SIGNS[type] ?? CATEGORY_SIGNS[category] ?? "▸";
}
