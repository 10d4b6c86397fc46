// Plays the past at a chosen speed, by looking at one moment after the other.

import { useEffect } from "preact/hooks";
import { useSignal } from "@preact/signals";
import { Icon } from "../Icon";
import type { Run } from "../run";

const SPEEDS = [0.5, 1, 2, 5, 10, 30];
const STEP = 100;

export function Player({ run, look }: { run: Run; look: (time: number) => void }) {
  const playing = useSignal(false);
  const speed = useSignal(1);
  useEffect(() => {
    if (!playing.value) return;
    let at = run.time >= run.last - 1e-3 ? run.first : run.time;
    let seen = performance.now();
    const timer = window.setInterval(() => {
      const now = performance.now();
      at += ((now - seen) / 1000) * speed.peek();
      seen = now;
      look(at);
      if (at >= run.last) playing.value = false;
    }, STEP);
    return () => window.clearInterval(timer);
  }, [playing.value, run]);
  if (run.live.value && playing.value) playing.value = false;
  const name = playing.value ? "Stop playing" : "Play from here";
  return (
    <div class="player">
      <button type="button" class="tool" aria-label={name} title={name} aria-pressed={playing.value} onClick={() => (playing.value = !playing.value)}>
        <Icon name={playing.value ? "pause" : "play"} />
      </button>
      <select aria-label="Speed of playing" value={String(speed.value)} onChange={(event) => (speed.value = Number(event.currentTarget.value))}>
        {SPEEDS.map((value) => <option key={value} value={String(value)}>{value}×</option>)}
      </select>
    </div>
  );
}
