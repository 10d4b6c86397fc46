// Joint positions over time, drawn by uPlot; the list of joints is its legend and its switch.

import { useEffect, useRef } from "preact/hooks";
import { useSignal, useSignalEffect } from "@preact/signals";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { askSeries } from "../monitor";
import type { Run } from "../run";
import { FONT, palette } from "../theme";

const COLOURS = ["#3b82f6", "#d97706", "#0d9488", "#c2416b", "#7c5ce0", "#65a30d", "#a16a4a", "#64748b"];
const FIRST_SHOWN = 6;
const HEIGHT = 170;

/** Arms before wheels: a wheel's angle only grows. */
function usual(names: string[]): string[] {
  return names.filter((name) => !/wheel|caster|finger/i.test(name)).slice(0, FIRST_SHOWN);
}

export function JointPlot({ run }: { run: Run }) {
  const names = Object.keys(run.robot.joints ?? {});
  const chosen = useSignal<string[]>(usual(names));
  const host = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);

  useEffect(() => askSeries(run, names), [run]);
  useSignalEffect(() => {
    const colours = palette.value;
    plot.current?.destroy();
    const axis = { stroke: colours.muted, grid: { stroke: colours.line, width: 1 }, ticks: { show: false }, font: `10.5px ${FONT}` };
    plot.current = new uPlot(
      {
        width: host.current!.clientWidth,
        height: HEIGHT,
        legend: { show: false },
        cursor: { drag: { x: false, y: false }, points: { size: 5 } },
        scales: { x: { time: false } },
        axes: [{ ...axis, size: 26, values: (_, marks) => marks.map((mark) => `${mark} s`) }, { ...axis, size: 36 }],
        series: [{}, ...chosen.value.map((name) => ({ stroke: COLOURS[names.indexOf(name) % COLOURS.length]!, width: 1.5, spanGaps: true, points: { show: false } }))],
        hooks: {
          draw: [(drawn) => {
            if (run.live.peek()) return;
            const x = drawn.valToPos(run.time, "x", true);
            drawn.ctx.strokeStyle = colours.ink;
            drawn.ctx.beginPath();
            drawn.ctx.moveTo(x, drawn.bbox.top);
            drawn.ctx.lineTo(x, drawn.bbox.top + drawn.bbox.height);
            drawn.ctx.stroke();
          }],
        },
      },
      data(),
      host.current!,
    );
  });
  useSignalEffect(() => {
    void run.beat.value;
    plot.current?.setData(data());
  });
  useEffect(() => {
    const watching = new ResizeObserver(([entry]) => plot.current?.setSize({ width: entry!.contentRect.width, height: HEIGHT }));
    watching.observe(host.current!);
    return () => {
      watching.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  }, []);

  function data(): uPlot.AlignedData {
    const { times, positions } = run.joints;
    return [times, ...chosen.peek().map((name) => positions.get(name) ?? times.map(() => null))] as uPlot.AlignedData;
  }
  const turn = (name: string): void => {
    chosen.value = chosen.value.includes(name) ? chosen.value.filter((other) => other !== name) : [...chosen.value, name];
  };

  return (
    <section class="joints" aria-label="Joints">
      <h3>Joints <span class="hint">rad, m</span></h3>
      <div class="plot" ref={host} role="img" aria-label={`Positions over time of ${chosen.value.join(", ") || "no joint"}`} />
      <div class="joint-list">
        {names.map((name, i) => (
          <button type="button" key={name} class="joint" aria-pressed={chosen.value.includes(name)} onClick={() => turn(name)}>
            <svg class="swatch" viewBox="0 0 10 10" aria-hidden="true"><circle cx="5" cy="5" r="4" fill={COLOURS[i % COLOURS.length]} /></svg>
            <span class="joint-name">{name}</span>
            <span class="numbers">{run.robot.joints?.[name]?.toFixed(3)}</span>
          </button>
        ))}
      </div>
    </section>
  );
}
