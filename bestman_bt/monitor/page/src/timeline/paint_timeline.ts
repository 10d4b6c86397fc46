// Paints the timeline: lanes of spans, marks, the axis, and where one looks.

import { FAILURE, IDLE, RUNNING } from "../states";
import { FONT, type Palette } from "../theme";
import type { Mark } from "../protocol";
import type { Lane } from "./lanes";

export const GUTTER = 148;
export const AXIS = 18;
export const TALL_LANE = 18;
export const SLIM_LANE = 15;
const MARKS = 12;
const SIGNED = 13;
const NAMED = 26;
const HATCH = 5;
const SIGNS = ["◌", "", "✓", "✕", "↷", "–"];
export const RIGHT = 16;

export interface TimelinePicture {
  width: number;
  height: number;
  gutter: number;
  first: number;
  last: number;
  time: number;
  live: boolean;
  lanes: Lane[];
  marks: Mark[];
  tall: boolean;
  selected: number;
  nameOf: (index: number) => string;
}

export function positionOf(time: number, picture: { width: number; gutter: number; first: number; last: number }): number {
  const span = Math.max(0.5, picture.last - picture.first);
  return picture.gutter + ((time - picture.first) / span) * (picture.width - picture.gutter - RIGHT);
}

/** A step of 1, 2 or 5 times a power of ten, or of minutes, that leaves about `room` pixels between labels. */
function stepOf(span: number, width: number, room: number): number {
  const least = (span * room) / Math.max(1, width);
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600];
  return steps.find((step) => step >= least) ?? 7200;
}

function label(time: number): string {
  if (time < 60) return `${Number(time.toFixed(1))} s`;
  return `${Math.floor(time / 60)}:${String(Math.round(time % 60)).padStart(2, "0")}`;
}

export function paintTimeline(context: CanvasRenderingContext2D, picture: TimelinePicture, colours: Palette): void {
  const { width, height, first, last, lanes, tall, gutter } = picture;
  const at = (time: number): number => positionOf(time, picture);
  context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = `500 10.5px ${FONT}`;
  context.textBaseline = "middle";

  const playhead = at(Math.min(last, Math.max(first, picture.time)));
  const step = stepOf(last - first, width - gutter, 64);
  for (let time = Math.ceil(first / step) * step; time <= last + 1e-6; time += step) {
    const x = Math.round(at(time)) + 0.5;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x, AXIS);
    context.lineTo(x, height);
    context.stroke();
    context.fillStyle = colours.muted;
    context.textAlign = time === 0 ? "left" : "center";
    if (Math.abs(x - playhead) > 26) context.fillText(label(time), x, AXIS / 2);
  }

  const lane = tall ? TALL_LANE : SLIM_LANE;
  const top = AXIS + MARKS + 2;
  lanes.forEach((row, i) => {
    const y = top + i * lane;
    if (tall) {
      if (row.index === picture.selected) {
        context.fillStyle = colours.soft[RUNNING]!;
        context.fillRect(0, y, width, lane);
      }
      context.fillStyle = row.index === picture.selected ? colours.ink : colours.muted;
      context.textAlign = "left";
      context.fillText(row.name, 10, y + lane / 2, gutter - 20);
    }
    let drawnTo = -1;
    for (const { span, index, worked, shown } of row.spans) {
      const x = at(span.from);
      const wide = Math.max(2, at(span.to) - x - 0.5);
      // Of many spans within one pixel, one is drawn.
      if (x + wide <= drawnTo + 0.5) continue;
      drawnTo = x + wide;
      const halted = shown === IDLE;
      context.fillStyle = halted ? colours.surface : colours.states[shown]!;
      context.globalAlpha = worked ? 0.92 : tall ? 0.32 : 0.6;
      context.beginPath();
      context.roundRect(x, y + 2, wide, lane - 4, Math.min(3, wide / 2));
      context.fill();
      context.globalAlpha = 1;
      if (halted) hatch(context, x, y + 2, wide, lane - 4, colours.faint);
      context.fillStyle = halted ? colours.ink : colours.sign;
      const signed = worked && wide >= SIGNED;
      if (signed) {
        context.textAlign = "right";
        context.fillText(SIGNS[shown]!, x + wide - 3, y + lane / 2 + 0.5);
      }
      if (tall || wide < NAMED) continue;
      context.textAlign = "left";
      context.save();
      context.beginPath();
      context.rect(x, y, wide - (signed ? SIGNED + 2 : 4), lane);
      context.clip();
      context.fillText(picture.nameOf(index), x + 5, y + lane / 2 + 0.5);
      context.restore();
    }
  });

  for (const mark of picture.marks) paintMark(context, mark, at(mark.time), AXIS + MARKS / 2, colours);

  const x = playhead;
  context.strokeStyle = context.fillStyle = picture.live ? colours.states[RUNNING]! : colours.ink;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x, AXIS - 2);
  context.lineTo(x, height);
  context.stroke();
  context.beginPath();
  context.moveTo(x - 6, 4);
  context.lineTo(x + 6, 4);
  context.lineTo(x + 6, 11);
  context.lineTo(x, AXIS - 1);
  context.lineTo(x - 6, 11);
  context.closePath();
  context.fill();
}

/** Fills the path that was begun last: work that was halted before its end. */
function hatch(context: CanvasRenderingContext2D, x: number, y: number, wide: number, high: number, colour: string): void {
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.stroke();
  context.save();
  context.clip();
  context.beginPath();
  for (let at = x - high; at < x + wide; at += HATCH) {
    context.moveTo(at, y + high);
    context.lineTo(at + high, y);
  }
  context.stroke();
  context.restore();
}

/** Failures as squares, warnings as triangles, all else as small discs. */
function paintMark(context: CanvasRenderingContext2D, mark: Mark, x: number, y: number, colours: Palette): void {
  context.beginPath();
  if (mark.kind === "error" || mark.kind === "failure") {
    context.fillStyle = colours.states[FAILURE]!;
    context.roundRect(x - 4, y - 4, 8, 8, 1.5);
  } else if (mark.kind === "warning") {
    context.fillStyle = colours.scan;
    context.moveTo(x, y - 5);
    context.lineTo(x + 5, y + 4);
    context.lineTo(x - 5, y + 4);
  } else {
    context.fillStyle = mark.kind === "image" ? colours.faint : colours.muted;
    context.arc(x, y, 3, 0, 2 * Math.PI);
  }
  context.fill();
}
