// The run from its start to now: drag to look at any moment of it, also while it goes on.

import { useEffect, useMemo, useRef } from "preact/hooks";
import { useSignal, useSignalEffect } from "@preact/signals";
import { seconds } from "../describe";
import { Icon } from "../Icon";
import { goLive, isLive, seek, summary } from "../monitor";
import type { Run } from "../run";
import { IDLE, stateName } from "../states";
import { palette } from "../theme";
import { tallTimeline } from "../view_options";
import { laneByNode, packed } from "./lanes";
import { AXIS, GUTTER, paintTimeline, positionOf, RIGHT, SLIM_LANE, TALL_LANE } from "./paint_timeline";
import { Player } from "./Player";

const SEEK_EVERY = 60;
const NEAR_MARK = 7;
const SLIM_HEIGHT = 82;

export function Timeline({ run, follow }: { run: Run; follow: Run | null }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const sent = useRef({ at: 0, timer: 0 });
  const tip = useSignal<{ x: number; words: string } | null>(null);
  const tall = tallTimeline.value;
  const tree = run.tree.value;
  const { spans, marks, last } = run.timeline.value;
  const over = summary(run)?.state === "ended";
  const lanes = useMemo(
    () => (tree === null ? [] : (tall ? laneByNode : packed)(spans, tree, last, over)),
    [tree, spans, tall, last, over],
  );
  const height = tall ? Math.max(120, AXIS + 20 + lanes.length * TALL_LANE) : SLIM_HEIGHT;
  const gutter = tall && innerWidth > 720 ? GUTTER : 12;

  const frame = () => {
    const element = canvas.current!;
    return { width: element.clientWidth, height, gutter, first: run.first, last: run.last };
  };
  const draw = (): void => {
    const element = canvas.current;
    if (element === null || element.clientWidth === 0) return;
    const [wide, high] = [Math.round(element.clientWidth * devicePixelRatio), Math.round(height * devicePixelRatio)];
    if (element.width !== wide || element.height !== high) [element.width, element.height] = [wide, high];
    paintTimeline(
      element.getContext("2d")!,
      {
        ...frame(), time: run.time, live: run.live.peek() && isLive(run), lanes, marks, tall,
        selected: run.selected.peek(), nameOf: (index) => tree!.nodes[index]!.name,
      },
      palette.peek(),
    );
  };
  const latest = useRef(draw);
  latest.current = draw;
  useEffect(draw);
  useSignalEffect(() => {
    void [run.beat.value, palette.value, run.selected.value];
    latest.current();
  });
  useEffect(() => {
    const watching = new ResizeObserver(() => latest.current());
    watching.observe(canvas.current!);
    return () => watching.disconnect();
  }, []);

  /** At most every SEEK_EVERY ms, the last one always. */
  const look = (time: number): void => {
    const bounded = Math.max(run.first, Math.min(run.last, time));
    run.time = bounded;
    run.live.value = false;
    draw();
    window.clearTimeout(sent.current.timer);
    const send = (): void => {
      sent.current.at = performance.now();
      seek(run, bounded);
      if (follow !== null) seek(follow, bounded);
    };
    const wait = sent.current.at + SEEK_EVERY - performance.now();
    if (wait <= 0) send();
    else sent.current.timer = window.setTimeout(send, wait);
  };
  const timeAt = (event: PointerEvent): number => {
    const { width, gutter: left, first, last } = frame();
    const part = (event.offsetX - left) / Math.max(1, width - left - RIGHT);
    return first + part * Math.max(0.5, last - first);
  };
  const wordsAt = (event: PointerEvent): string => {
    const near = marks.find((mark) => Math.abs(positionOf(mark.time, frame()) - event.offsetX) < NEAR_MARK && event.offsetY < AXIS + 14);
    if (near !== undefined) return `${seconds(near.time)} · ${near.kind}: ${near.text}`;
    const time = timeAt(event);
    const row = lanes[Math.floor((event.offsetY - AXIS - 14) / (tall ? TALL_LANE : SLIM_LANE))];
    const item = row?.spans.find(({ span }) => time >= span.from && time <= span.to);
    if (item === undefined) return seconds(time);
    const came = item.shown === IDLE ? "halted" : stateName(item.shown).toLowerCase();
    return `${seconds(time)} · ${tree!.nodes[item.index]!.name}: ${came}`;
  };

  void run.beat.value;
  const watched = isLive(run);
  const behind = run.last - run.time;
  return (
    <section class={`timeline${tall ? " tall" : ""}`} aria-label="Timeline">
      <div class="timeline-bar">
        <Player run={run} look={look} />
        <output class="numbers clock" aria-label="Time shown">{seconds(run.time)}</output>
        <span class="numbers of">of {seconds(run.last)}</span>
        {watched && (
          <button type="button" class={`button live${run.live.value ? " on" : ""}`} aria-pressed={run.live.value} onClick={() => goLive(run)}>
            <span class="live-dot" /> {run.live.value ? "Live" : `Live · ${seconds(behind)} ago shown`}
          </button>
        )}
        <span class="spacer" />
        <span class="tip" role="status">{tip.value?.words}</span>
        <button type="button" class="tool" aria-pressed={tall} aria-label="Lanes by node (M)" title="Lanes by node (M)" onClick={() => (tallTimeline.value = !tall)}>
          <Icon name="tall" />
        </button>
      </div>
      <div class="timeline-scroll">
        <canvas
          ref={canvas} style={{ height: `${height}px` }} tabIndex={0} role="slider" aria-label="Moment of the run"
          aria-valuemin={run.first} aria-valuemax={run.last} aria-valuenow={Number(run.time.toFixed(2))} aria-valuetext={seconds(run.time)}
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            look(timeAt(event));
          }}
          onPointerMove={(event) => {
            if (event.buttons !== 0) look(timeAt(event));
            tip.value = { x: event.offsetX, words: wordsAt(event) };
          }}
          onPointerLeave={() => (tip.value = null)}
          onKeyDown={(event) => {
            const jump: Record<string, number> = {
              ArrowLeft: run.time - 0.2, ArrowRight: run.time + 0.2, ArrowDown: run.time - 0.2, ArrowUp: run.time + 0.2,
              PageUp: run.time - 10, PageDown: run.time + 10, Home: run.first,
            };
            if (event.key === "End" && watched) goLive(run);
            else if (event.key === "End") look(run.last);
            else if (event.key in jump) look(jump[event.key]!);
            else return;
            event.preventDefault();
            event.stopPropagation();
          }}
        />
      </div>
    </section>
  );
}
