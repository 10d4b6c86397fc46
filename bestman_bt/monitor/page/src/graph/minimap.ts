// The whole tree in a corner, when only a part of it is seen.

import { IDLE } from "../states";
import type { Palette } from "../theme";
import type { Camera } from "./camera";
import { CARD_HEIGHT, type Layout } from "./layout";

const MARGIN = 6;
const EVERY = 150;

export class Minimap {
  private painted = -Infinity;
  private scale = 1;
  private left = 0;
  private top = 0;

  constructor(private readonly canvas: HTMLCanvasElement) {}

  /** Hides itself while the whole tree is in view; returns whether it still has to be painted, later. */
  paint(layout: Layout, states: Uint8Array, camera: Camera, colours: Palette, now: number): boolean {
    const seen = camera.seen();
    const all = seen.left <= layout.left && seen.right >= layout.right && seen.top <= layout.top && seen.bottom >= layout.bottom;
    this.canvas.hidden = all;
    if (all) return false;
    if (now - this.painted < EVERY) return true;
    this.painted = now;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = devicePixelRatio;
    if (this.canvas.width !== width * ratio) [this.canvas.width, this.canvas.height] = [width * ratio, height * ratio];
    const context = this.canvas.getContext("2d")!;
    this.scale = Math.min((width - 2 * MARGIN) / (layout.right - layout.left), (height - 2 * MARGIN) / (layout.bottom - layout.top));
    this.left = width / 2 - ((layout.left + layout.right) / 2) * this.scale;
    this.top = height / 2 - ((layout.top + layout.bottom) / 2) * this.scale;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    for (let state = 0; state < colours.states.length; state++) {
      context.fillStyle = state === IDLE ? colours.faint : colours.states[state]!;
      for (const card of layout.cards) {
        if (states[card.index] !== state) continue;
        context.fillRect(
          this.left + card.x * this.scale, this.top + card.y * this.scale,
          Math.max(1.5, card.width * this.scale - 0.5), Math.max(1.2, CARD_HEIGHT * this.scale),
        );
      }
    }
    context.strokeStyle = colours.accent;
    context.lineWidth = 1.5;
    const [x, y] = [Math.max(1, this.left + seen.left * this.scale), Math.max(1, this.top + seen.top * this.scale)];
    context.strokeRect(
      x, y,
      Math.min(width - 1, this.left + seen.right * this.scale) - x,
      Math.min(height - 1, this.top + seen.bottom * this.scale) - y,
    );
    return false;
  }

  /** The point of the drawing under a point of the minimap. */
  point(event: PointerEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [(event.clientX - box.left - this.left) / this.scale, (event.clientY - box.top - this.top) / this.scale];
  }
}
