// The map from above: free space and walls, furniture, lidar points, the planned and the driven path, the base.

import { useEffect, useRef } from "preact/hooks";
import { useSignalEffect } from "@preact/signals";
import { Camera, type Box } from "../graph/camera";
import { Icon } from "../Icon";
import type { MapRecord } from "../protocol";
import type { Run } from "../run";
import { FONT, palette, type Palette } from "../theme";

const FREE_FROM = 200;
const WALL_TO = 90;
const AROUND_ROBOT = 3;

class MapView {
  readonly camera = new Camera(4, 400);
  private pixels: ImageData | null = null;
  private grid: { source: unknown; colours: Palette; picture: HTMLCanvasElement } | null = null;
  private fitted = "";
  private due = 0;
  private readonly watching: ResizeObserver;

  constructor(private readonly run: Run, private readonly canvas: HTMLCanvasElement) {
    this.watching = new ResizeObserver(() => this.resize());
    this.watching.observe(canvas);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.camera.zoomAt(event.offsetX, event.offsetY, Math.exp(-event.deltaY * 0.0016));
      this.redraw();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) return;
      this.camera.pan(event.movementX, event.movementY);
      this.redraw();
    });
  }

  close(): void {
    this.watching.disconnect();
    cancelAnimationFrame(this.due);
  }

  async load(map: MapRecord | null): Promise<void> {
    this.pixels = null;
    if (map?.png) {
      const bytes = Uint8Array.from(atob(map.png), (letter) => letter.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" })).catch(() => null);
      // A damaged grid leaves walls and furniture.
      if (bitmap === null) return this.redraw();
      const scratch = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d", { willReadFrequently: true })!;
      scratch.drawImage(bitmap, 0, 0);
      this.pixels = scratch.getImageData(0, 0, bitmap.width, bitmap.height);
    }
    this.redraw();
  }

  fit(): void {
    this.camera.fit(this.extent(), performance.now(), 150);
    this.redraw();
  }

  redraw(): void {
    this.due ||= requestAnimationFrame((now) => {
      this.due = 0;
      this.draw(now);
    });
  }

  private resize(): void {
    this.camera.width = this.canvas.clientWidth;
    this.camera.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.camera.width * devicePixelRatio);
    this.canvas.height = Math.round(this.camera.height * devicePixelRatio);
    this.fitted = "";
    this.redraw();
  }

  /** In drawing coordinates: metres, y down. */
  private extent(): Box {
    const map = this.run.map.peek();
    if (map !== null) {
      const [x, y] = map.origin;
      return { left: x, right: x + map.width * map.resolution, top: -y - map.height * map.resolution, bottom: -y };
    }
    const [x, y] = this.run.robot.base ?? [0, 0];
    const points = [...(this.run.scan?.points ?? []), [x - AROUND_ROBOT, y - AROUND_ROBOT], [x + AROUND_ROBOT, y + AROUND_ROBOT]];
    const xs = points.map((point) => point[0]!);
    const ys = points.map((point) => -point[1]!);
    return { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  }

  /** The grid in the theme's colours: white is free, black is occupied, what lies between is unknown. */
  private gridPicture(colours: Palette): HTMLCanvasElement | null {
    const source = this.pixels;
    if (source === null) return null;
    if (this.grid?.source === source && this.grid.colours === colours) return this.grid.picture;
    const picture = document.createElement("canvas");
    [picture.width, picture.height] = [source.width, source.height];
    const context = picture.getContext("2d", { willReadFrequently: true })!;
    const colour = (css: string): Uint8ClampedArray => {
      context.fillStyle = css;
      context.fillRect(0, 0, 1, 1);
      return context.getImageData(0, 0, 1, 1).data;
    };
    const [free, wall] = [colour(colours.free), colour(colours.wall)];
    const painted = context.createImageData(source.width, source.height);
    for (let i = 0; i < source.data.length; i += 4) {
      const light = source.data[i]!;
      if (light >= FREE_FROM) painted.data.set(free, i);
      else if (light <= WALL_TO) painted.data.set(wall, i);
    }
    context.putImageData(painted, 0, 0);
    this.grid = { source, colours, picture };
    return picture;
  }

  private draw(now: number): void {
    const { run, camera } = this;
    const context = this.canvas.getContext("2d")!;
    const colours = palette.peek();
    const wanted = run.map.peek() === null ? "robot" : "map";
    if (this.fitted !== wanted && camera.width > 10) {
      this.fitted = wanted;
      camera.fit(this.extent(), 0, 150);
    }
    const moving = camera.advance(now);
    const ratio = devicePixelRatio;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    // From here on: metres in the map frame, y up.
    context.setTransform(ratio * camera.zoom, 0, 0, -ratio * camera.zoom, ratio * camera.x, ratio * camera.y);
    const pixel = 1 / camera.zoom;
    this.drawMap(context, colours, pixel);
    const line = (xs: number[], ys: number[], colour: string, width: number, dash: number[] = []): void => {
      context.beginPath();
      xs.forEach((x, i) => (i === 0 ? context.moveTo(x, ys[i]!) : context.lineTo(x, ys[i]!)));
      context.strokeStyle = colour;
      context.lineWidth = width * pixel;
      context.lineJoin = "round";
      context.setLineDash(dash.map((length) => length * pixel));
      context.stroke();
      context.setLineDash([]);
    };
    line(run.trail.x, run.trail.y, colours.muted, 2);
    line(run.path.map((point) => point[0]), run.path.map((point) => point[1]), colours.accent, 2, [6, 4]);
    context.fillStyle = colours.scan;
    for (const [x, y] of run.scan?.points ?? []) context.fillRect(x - 1.2 * pixel, y - 1.2 * pixel, 2.4 * pixel, 2.4 * pixel);
    for (const outline of run.paused.peek()?.swept ?? []) {
      context.beginPath();
      outline.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
      context.closePath();
      context.fillStyle = context.strokeStyle = colours.accent;
      context.globalAlpha = 0.25;
      context.fill();
      context.globalAlpha = 1;
      context.lineWidth = pixel;
      context.stroke();
    }
    if (run.robot.base !== undefined) drawBase(context, run.robot.base, run.robot.believed_std?.[0] ?? 0, pixel, colours);
    if (moving) this.redraw();
  }

  private drawMap(context: CanvasRenderingContext2D, colours: Palette, pixel: number): void {
    const map = this.run.map.peek();
    if (map === null) return;
    const grid = this.gridPicture(colours);
    const [x, y] = map.origin;
    if (grid === null) {
      context.fillStyle = colours.free;
      context.fillRect(x, y, map.width * map.resolution, map.height * map.resolution);
    } else {
      context.save();
      context.translate(x, y + map.height * map.resolution);
      context.scale(map.resolution, -map.resolution);
      context.imageSmoothingEnabled = false;
      context.drawImage(grid, 0, 0);
      context.restore();
    }
    const outline = (polygon: [number, number][]): void => {
      context.beginPath();
      polygon.forEach(([px, py], i) => (i === 0 ? context.moveTo(px, py) : context.lineTo(px, py)));
      context.closePath();
    };
    context.beginPath();
    for (const [x1, y1, x2, y2] of map.walls ?? []) {
      context.moveTo(x1, y1);
      context.lineTo(x2, y2);
    }
    context.strokeStyle = colours.wall;
    context.lineWidth = 3 * pixel;
    context.lineCap = "square";
    context.stroke();
    for (const { name, polygon } of map.furniture ?? []) {
      outline(polygon);
      context.fillStyle = colours.raised;
      context.fill();
      context.strokeStyle = colours.muted;
      context.lineWidth = pixel;
      context.stroke();
      const at = polygon.reduce((sum, [px, py]) => [sum[0]! + px / polygon.length, sum[1]! + py / polygon.length], [0, 0]);
      const wide = (Math.max(...polygon.map(([px]) => px)) - Math.min(...polygon.map(([px]) => px))) / pixel;
      context.save();
      context.translate(at[0]!, at[1]!);
      context.scale(pixel, -pixel);
      context.font = `500 10px ${FONT}`;
      context.fillStyle = colours.muted;
      context.textAlign = "center";
      context.textBaseline = "middle";
      if (context.measureText(name).width < wide + 16) context.fillText(name, 0, 0);
      context.restore();
    }
  }
}

/** A disc with its heading; around it what it believes about its own place, at two standard deviations. */
function drawBase(context: CanvasRenderingContext2D, base: [number, number, number], spread: number, pixel: number, colours: Palette): void {
  const radius = Math.max(0.25, 6 * pixel);
  context.save();
  context.translate(base[0], base[1]);
  context.rotate(base[2]);
  context.globalAlpha = 0.2;
  context.fillStyle = colours.accent;
  context.beginPath();
  context.arc(0, 0, radius + 2 * spread, 0, 2 * Math.PI);
  context.fill();
  context.globalAlpha = 1;
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fill();
  context.strokeStyle = colours.surface;
  context.lineWidth = 1.5 * pixel;
  context.stroke();
  context.beginPath();
  context.moveTo(radius * 0.75, 0);
  context.lineTo(-radius * 0.35, radius * 0.5);
  context.lineTo(-radius * 0.1, 0);
  context.lineTo(-radius * 0.35, -radius * 0.5);
  context.closePath();
  context.fillStyle = colours.surface;
  context.fill();
  context.restore();
}

export function RobotMap({ run }: { run: Run }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<MapView | null>(null);
  useEffect(() => {
    const made = new MapView(run, canvas.current!);
    view.current = made;
    void made.load(run.map.peek());
    return () => made.close();
  }, [run]);
  useSignalEffect(() => void view.current?.load(run.map.value));
  useSignalEffect(() => {
    void [run.frame.value, run.paused.value, palette.value];
    view.current?.redraw();
  });
  const base = run.robot.base;
  const where = base === undefined ? "" : `; base at ${base[0].toFixed(1)}, ${base[1].toFixed(1)}`;
  return (
    <div class="map">
      <canvas ref={canvas} role="img" aria-label={`Map with lidar, paths and base${where}`} />
      <button type="button" class="tool" aria-label="Show the whole map" title="Show the whole map" onClick={() => view.current?.fit()}>
        <Icon name="fit" />
      </button>
      <ul class="map-key" aria-label="Lines of the map">
        <li class="key-scan">lidar</li><li class="key-plan">planned</li><li class="key-driven">driven</li>
      </ul>
    </div>
  );
}
