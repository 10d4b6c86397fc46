// What part of the drawing is seen: pan, zoom at a point, fit, and a short glide between views.

import { calm } from "../theme";

const GLIDE = 220;

export interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

export class Camera {
  x = 0;
  y = 0;
  zoom = 1;
  width = 1;
  height = 1;
  constructor(private readonly least = 0.008, private readonly most = 2.5) {}

  private glide: { from: [number, number, number]; to: [number, number, number]; start: number } | null = null;

  pan(dx: number, dy: number): void {
    this.glide = null;
    this.x += dx;
    this.y += dy;
  }

  zoomAt(px: number, py: number, factor: number): void {
    this.glide = null;
    const zoom = Math.min(this.most, Math.max(this.least, this.zoom * factor));
    this.x = px - ((px - this.x) * zoom) / this.zoom;
    this.y = py - ((py - this.y) * zoom) / this.zoom;
    this.zoom = zoom;
  }

  /** Takes another size; what was in the middle stays there. */
  resize(width: number, height: number): void {
    const [dx, dy] = [(width - this.width) / 2, (height - this.height) / 2];
    [this.width, this.height] = [width, height];
    this.x += dx;
    this.y += dy;
    for (const view of this.glide === null ? [] : [this.glide.from, this.glide.to]) {
      view[0] += dx;
      view[1] += dy;
    }
  }

  toDrawing(px: number, py: number): [number, number] {
    return [(px - this.x) / this.zoom, (py - this.y) / this.zoom];
  }

  seen(): Box {
    const [left, top] = this.toDrawing(0, 0);
    const [right, bottom] = this.toDrawing(this.width, this.height);
    return { left, top, right, bottom };
  }

  fit(box: Box, now: number, most = 1.15): void {
    const margin = Math.min(36, this.width * 0.05);
    const zoom = Math.min(
      most,
      (this.width - 2 * margin) / Math.max(1, box.right - box.left),
      (this.height - 2 * margin) / Math.max(1, box.bottom - box.top),
    );
    const bounded = Math.max(this.least, zoom);
    this.go(
      this.width / 2 - ((box.left + box.right) / 2) * bounded,
      this.height / 2 - ((box.top + box.bottom) / 2) * bounded,
      bounded,
      now,
    );
  }

  centre(x: number, y: number, now: number, zoom = this.zoom): void {
    this.go(this.width / 2 - x * zoom, this.height / 2 - y * zoom, zoom, now);
  }

  /** The least pan after which the box, with a margin, is seen. */
  reveal(box: Box, margin: number, now: number): void {
    const [x, y, zoom] = this.glide?.to ?? [this.x, this.y, this.zoom];
    const shift = (low: number, high: number, size: number): number => {
      if (high - low > size - 2 * margin || low < margin) return margin - low;
      return high > size - margin ? size - margin - high : 0;
    };
    const dx = shift(box.left * zoom + x, box.right * zoom + x, this.width);
    const dy = shift(box.top * zoom + y, box.bottom * zoom + y, this.height);
    if (dx !== 0 || dy !== 0) this.go(x + dx, y + dy, zoom, now);
  }

  private go(x: number, y: number, zoom: number, now: number): void {
    if (calm.matches || now === 0) [this.x, this.y, this.zoom, this.glide] = [x, y, zoom, null];
    else this.glide = { from: [this.x, this.y, this.zoom], to: [x, y, zoom], start: now };
  }

  /** Moves along the glide; true while it goes on. */
  advance(now: number): boolean {
    if (this.glide === null) return false;
    const part = Math.min(1, Math.max(0, (now - this.glide.start) / GLIDE));
    const eased = 1 - (1 - part) ** 3;
    const { from, to } = this.glide;
    this.x = from[0] + (to[0] - from[0]) * eased;
    this.y = from[1] + (to[1] - from[1]) * eased;
    this.zoom = from[2] + (to[2] - from[2]) * eased;
    if (part === 1) this.glide = null;
    return this.glide !== null;
  }
}
