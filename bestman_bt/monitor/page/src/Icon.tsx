// Small line drawings for buttons, and the shapes of the states; all decorative, the button carries the name.

import { STATE_SHAPES, stateName } from "./states";

const ICONS: Record<string, string> = {
  plus: "M8 3v10M3 8h10",
  minus: "M3 8h10",
  fit: "M2.500 6V2.500H6M10 2.500h3.500V6M13.500 10v3.500H10M6 13.500H2.500V10",
  follow: "M8 1.500v3M8 11.500v3M1.500 8h3M11.500 8h3M8 6.200a1.800 1.800 0 1 0 .01 0z",
  turn: "M3 6.500a5.500 5.500 0 0 1 9.500-2.200L14 6M14 2v4h-4M13 9.500a5.500 5.500 0 0 1-9.500 2.200L2 10M2 14v-4h4",
  unfold: "M8 1.500v5M8 14.500v-5M5.500 4 8 1.500 10.500 4M5.500 12 8 14.500 10.500 12",
  fold: "M8 1.500v4.500M8 14.500V10M5.500 3.700 8 6.200l2.500-2.500M5.500 12.300 8 9.800l2.500 2.500",
  outline: "M2.500 3.500h7M5.500 8h8M5.500 12.500h8M2.500 8h.5M2.500 12.500h.5",
  drawing: "M2 6.500h3.500v3H2zM10.500 2H14v3h-3.500zM10.500 11H14v3h-3.500zM5.500 8h2.500M10.500 3.500H8v9h2.500",
  pause: "M5.500 3v10M10.500 3v10",
  play: "M4.500 2.500 13 8l-8.500 5.500z",
  step: "M3 3l6 5-6 5zM12 3v10",
  halt: "M3.500 3.500h9v9h-9z",
  stop: "M5.200 1.500h5.600l3.700 3.700v5.600l-3.700 3.700H5.200L1.500 10.800V5.200z",
  help: "M5.800 6a2.300 2.300 0 1 1 3.500 2c-.9.6-1.300 1-1.300 2M8 12.700v.1",
  moon: "M13 9.800A5.700 5.700 0 0 1 6.200 3a5.700 5.700 0 1 0 6.800 6.800z",
  sun: "M8 5.200a2.800 2.800 0 1 0 .01 0zM8 1v1.500M8 13.500V15M1 8h1.500M13.500 8H15M3 3l1.100 1.100M11.900 11.900 13 13M13 3l-1.100 1.100M4.100 11.900 3 13",
  search: "M7 2.500a4.500 4.500 0 1 0 .01 0zM10.300 10.300 14 14",
  close: "M3.500 3.500l9 9M12.500 3.500l-9 9",
  down: "M4 6l4 4 4-4",
  right: "M6 4l4 4-4 4",
  edit: "M3 13l.7-3L11 2.700l2.300 2.300L6 12.300z",
  compare: "M2 3h4.500v10H2zM9.500 3H14v10H9.500z",
  tall: "M3 4h10M3 8h6M3 12h8",
  before: "M12.500 3v10L5 8zM3.500 3v10",
  check: "M3 8.500 6.500 12 13 4.500",
};

export function Icon({ name }: { name: string }) {
  return (
    <svg class="icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={ICONS[name]} />
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
