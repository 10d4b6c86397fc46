// Small line drawings for buttons, and the shapes of the states; all decorative, the button carries the name.

import { STATE_SHAPES, stateName } from "./states";

const ICONS: Record<string, string> = {
  plus: "M8 3v10M3 8h10",
  minus: "M3 8h10",
  fit: "M2.5 6V2.5H6M10 2.5h3.5V6M13.5 10v3.5H10M6 13.5H2.5V10",
  follow: "M8 1.5v3M8 11.5v3M1.5 8h3M11.5 8h3M8 6.2a1.8 1.8 0 1 0 .01 0z",
  turn: "M3 6.5a5.5 5.5 0 0 1 9.5-2.2L14 6M14 2v4h-4M13 9.5a5.5 5.5 0 0 1-9.5 2.2L2 10M2 14v-4h4",
  unfold: "M8 1.5v5M8 14.5v-5M5.5 4 8 1.5 10.5 4M5.5 12 8 14.5 10.5 12",
  fold: "M8 1.5v4.5M8 14.5V10M5.5 3.7 8 6.2l2.5-2.5M5.5 12.3 8 9.8l2.5 2.5",
  outline: "M2.5 3.5h7M5.5 8h8M5.5 12.5h8M2.5 8h.5M2.5 12.5h.5",
  drawing: "M2 6.5h3.5v3H2zM10.5 2H14v3h-3.5zM10.5 11H14v3h-3.5zM5.5 8h2.5M10.5 3.5H8v9h2.5",
  pause: "M5.5 3v10M10.5 3v10",
  play: "M4.5 2.5 13 8l-8.5 5.5z",
  step: "M3 3l6 5-6 5zM12 3v10",
  halt: "M3.5 3.5h9v9h-9z",
  stop: "M5.2 1.5h5.6l3.7 3.7v5.6l-3.7 3.7H5.2L1.5 10.8V5.2z",
  help: "M5.8 6a2.3 2.3 0 1 1 3.5 2c-.9.6-1.3 1-1.3 2M8 12.7v.1",
  moon: "M13 9.8A5.7 5.7 0 0 1 6.2 3a5.7 5.7 0 1 0 6.8 6.8z",
  sun: "M8 5.2a2.8 2.8 0 1 0 .01 0zM8 1v1.5M8 13.5V15M1 8h1.5M13.5 8H15M3 3l1.1 1.1M11.9 11.9 13 13M13 3l-1.1 1.1M4.1 11.9 3 13",
  search: "M7 2.5a4.5 4.5 0 1 0 .01 0zM10.3 10.3 14 14",
  close: "M3.5 3.5l9 9M12.5 3.5l-9 9",
  down: "M4 6l4 4 4-4",
  right: "M6 4l4 4-4 4",
  edit: "M3 13l.7-3L11 2.7l2.3 2.3L6 12.3z",
  compare: "M2 3h4.5v10H2zM9.5 3H14v10H9.5z",
  tall: "M3 4h10M3 8h6M3 12h8",
  before: "M12.5 3v10L5 8zM3.5 3v10",
  check: "M3 8.5 6.5 12 13 4.5",
};

export function Icon({ name }: { name: string }) {
  return (
    <svg class="icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={ICONS[name]} />
    </svg>
  );
}

/** Of a run that was broken off: no node is ever in such a state. */
export function BrokenShape() {
  return (
    <svg class="shape broken" viewBox="0 0 16 16" aria-hidden="true">
      <path class="outer" d="M6.8 1.1A7 7 0 0 0 5.6 14.6L7.7 9.4 5.3 7.3zM9.6 1.2A7 7 0 0 1 8.4 15L10.9 8.7 8.5 6.6z" />
    </svg>
  );
}

/** The shape of a state; with `named`, its name is there for readers. */
export function StateShape({ state, named = false, faint = false }: { state: number; named?: boolean; faint?: boolean }) {
  const { shape, sign } = STATE_SHAPES[state] ?? STATE_SHAPES[0]!;
  const name = stateName(state);
  return (
    <svg
      class={`shape ${name.toLowerCase()}${faint ? " faint" : ""}`} viewBox="0 0 16 16" role={named ? "img" : undefined}
      aria-label={named ? name : undefined} aria-hidden={named ? undefined : "true"}
    >
      <path class="outer" d={shape} />
      {sign !== "" && <path class="sign" d={sign} />}
    </svg>
  );
}
