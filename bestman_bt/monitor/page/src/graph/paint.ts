// Paints the tree: cards with text when there is room for it, bare shapes from afar; a thick line follows the current tick.

import { IDLE, RUNNING, STATE_SHAPES, kindSign } from "../states";
import { FONT, type Palette } from "../theme";
import { CARD_HEIGHT, NAME_FONT, TYPE_FONT, type Card, type Layout } from "./layout";
import type { Camera } from "./camera";
import type { Tree } from "../tree";

const TEXT_FROM = 0.5;
const SHAPES_FROM = 0.16;
const RADIUS = 8;
export const GLOW = 700;

const SHAPES = STATE_SHAPES.map(({ shape, sign }) => ({ shape: new Path2D(shape), sign: new Path2D(sign) }));

export interface Picture {
  tree: Tree;
  layout: Layout;
  states: Uint8Array;
  results: Uint8Array;
  changedAt: Float64Array;
  selected: number;
  hovered: number;
  found: ReadonlySet<number>;
  breakpoints: ReadonlySet<number>;
  stopped: number;
}

export function shapeOf(context: CanvasRenderingContext2D, state: number, x: number, y: number, size: number, colours: Palette): void {
  const { shape, sign } = SHAPES[state]!;
  context.save();
  context.translate(x, y);
  context.scale(size / 16, size / 16);
  if (state === IDLE) {
    context.lineWidth = 1.6;
    context.strokeStyle = colours.states[IDLE]!;
    context.stroke(shape);
  } else {
    context.fillStyle = colours.states[state]!;
    context.fill(shape);
    context.lineWidth = 2;
    context.lineCap = "round";
    context.lineJoin = "round";
    context.strokeStyle = colours.sign;
    context.stroke(sign);
  }
  context.restore();
}

export function edgePath(layout: Layout, cards: Iterable<Card>): Path2D {
  const path = new Path2D();
  for (const card of cards) {
    const from = card.parent;
    if (from === null) continue;
    if (layout.orientation === "right") {
      const [x0, y0, x1, y1] = [from.x + from.width, from.y + CARD_HEIGHT / 2, card.x, card.y + CARD_HEIGHT / 2];
      const bend = card.x - 20;
      path.moveTo(x0, y0);
      if (bend > x0) path.lineTo(bend - 12, y0);
      path.bezierCurveTo(bend + 2, y0, bend - 2, y1, x1, y1);
    } else {
      const [x0, y0, x1, y1] = [from.x + from.width / 2, from.y + CARD_HEIGHT, card.x + card.width / 2, card.y];
      path.moveTo(x0, y0);
      path.bezierCurveTo(x0, y0 + 22, x1, y1 - 22, x1, y1);
    }
  }
  return path;
}

/** Returns whether something still glows, so that another frame is due. */
export function paint(
  context: CanvasRenderingContext2D, camera: Camera, picture: Picture, edges: Path2D, colours: Palette, now: number,
): boolean {
  const { layout, states, changedAt } = picture;
  const scale = devicePixelRatio;
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, camera.width, camera.height);
  context.setTransform(scale * camera.zoom, 0, 0, scale * camera.zoom, scale * camera.x, scale * camera.y);
  const seen = camera.seen();
  const visible = layout.cards.filter(
    (card) => card.x + card.width > seen.left && card.x < seen.right && card.y + CARD_HEIGHT > seen.top && card.y < seen.bottom,
  );

  context.lineWidth = Math.max(1.2, 0.7 / camera.zoom);
  context.strokeStyle = colours.faint;
  context.stroke(edges);
  context.lineWidth = Math.max(2.6, 1.6 / camera.zoom);
  context.strokeStyle = colours.states[RUNNING]!;
  context.stroke(edgePath(layout, layout.cards.filter((card) => states[card.index] === RUNNING)));

  let glowing = false;
  for (const card of visible) {
    const age = now - changedAt[card.index]!;
    if (age < 0 || age > GLOW) continue;
    glowing = true;
    const spread = 5 / Math.max(0.35, camera.zoom);
    context.globalAlpha = 0.45 * (1 - age / GLOW);
    context.fillStyle = colours.states[states[card.index]!]!;
    context.beginPath();
    context.roundRect(card.x - spread, card.y - spread, card.width + 2 * spread, CARD_HEIGHT + 2 * spread, RADIUS + spread);
    context.fill();
    context.globalAlpha = 1;
  }
  if (camera.zoom >= TEXT_FROM) for (const card of visible) paintCard(context, card, picture, colours);
  else paintFar(context, visible, picture, camera.zoom, colours);
  for (const card of visible) paintMarks(context, card, picture, camera.zoom, colours);
  return glowing;
}

function paintCard(context: CanvasRenderingContext2D, card: Card, picture: Picture, colours: Palette): void {
  const node = picture.tree.nodes[card.index]!;
  const state = picture.states[card.index]!;
  if (card.hidden > 0) {
    context.fillStyle = colours.raised;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.beginPath();
    context.roundRect(card.x + 4, card.y + 4, card.width, CARD_HEIGHT, RADIUS);
    context.fill();
    context.stroke();
  }
  context.beginPath();
  context.roundRect(card.x, card.y, card.width, CARD_HEIGHT, node.category === "condition" ? CARD_HEIGHT / 2 : RADIUS);
  context.fillStyle = colours.raised;
  context.fill();
  context.fillStyle = colours.soft[state]!;
  context.fill();
  context.lineWidth = state === IDLE ? 1 : 1.5;
  context.strokeStyle = state === IDLE ? colours.faint : colours.states[state]!;
  if (node.category === "subtree" || node.placeholder) context.setLineDash([5, 3]);
  context.stroke();
  context.setLineDash([]);
  const result = picture.results[card.index]!;
  if (state === IDLE && result !== IDLE) context.globalAlpha = 0.55;
  shapeOf(context, state || result, card.x + 10, card.y + 10, 16, colours);
  context.globalAlpha = 1;
  context.textBaseline = "alphabetic";
  context.fillStyle = colours.ink;
  context.font = NAME_FONT;
  context.fillText(card.name, card.x + 34, card.y + 16);
  context.fillStyle = colours.muted;
  context.font = TYPE_FONT;
  context.fillText(`${kindSign(node.type, node.category)} ${card.kind}`, card.x + 34, card.y + 29);
}

function paintFar(context: CanvasRenderingContext2D, cards: Card[], picture: Picture, zoom: number, colours: Palette): void {
  const { states, results } = picture;
  for (let state = 0; state < STATE_SHAPES.length; state++) {
    context.fillStyle = zoom < SHAPES_FROM ? (state === IDLE ? colours.faint : colours.states[state]!) : colours.soft[state]!;
    context.strokeStyle = state === IDLE ? colours.line : colours.states[state]!;
    context.lineWidth = 1 / zoom;
    context.beginPath();
    for (const card of cards) {
      if (states[card.index] === state) context.rect(card.x, card.y, card.width, CARD_HEIGHT);
    }
    context.fill();
    if (zoom >= SHAPES_FROM) context.stroke();
  }
  if (zoom < SHAPES_FROM) return;
  for (const card of cards) {
    const state = states[card.index] || results[card.index]!;
    if (state === IDLE) continue;
    context.globalAlpha = states[card.index] === IDLE ? 0.5 : 1;
    shapeOf(context, state, card.x + card.width / 2 - 13, card.y + 5, 26, colours);
    context.globalAlpha = 1;
  }
}

function paintMarks(context: CanvasRenderingContext2D, card: Card, picture: Picture, zoom: number, colours: Palette): void {
  const ring = (colour: string, width: number, gap: number): void => {
    context.strokeStyle = colour;
    context.lineWidth = width / Math.min(1, zoom);
    context.beginPath();
    context.roundRect(card.x - gap, card.y - gap, card.width + 2 * gap, CARD_HEIGHT + 2 * gap, RADIUS + gap);
    context.stroke();
  };
  if (picture.found.has(card.index)) ring(colours.accent, 2, 3);
  if (card.index === picture.hovered) ring(colours.muted, 1, 2);
  if (card.index === picture.selected) ring(colours.ink, 2.2, 3);
  if (card.index === picture.stopped) ring(colours.states[3]!, 3, 5);
  if (picture.breakpoints.has(card.index)) {
    context.fillStyle = colours.states[3]!;
    context.strokeStyle = colours.canvas;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(card.x + 1, card.y + 1, 6 / Math.min(1, Math.max(zoom, 0.4)), 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  if (card.hidden > 0 && zoom >= TEXT_FROM) {
    const text = `+${card.hidden}`;
    context.font = `600 10px ${FONT}`;
    const width = context.measureText(text).width + 10;
    const left = card.x + card.width - width + 6;
    context.fillStyle = colours.ink;
    context.beginPath();
    context.roundRect(left, card.y - 7, width, 15, 7.5);
    context.fill();
    context.fillStyle = colours.surface;
    context.textBaseline = "middle";
    context.fillText(text, left + 5, card.y + 1);
  }
}
