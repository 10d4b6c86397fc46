// The drawing of one run's tree: ties camera, layout and painter together and turns pointer and wheel into moves.

import { palette } from "../theme";
import type { Run } from "../run";
import { Camera, type Box } from "./camera";
import { CARD_HEIGHT, layOut, type Card, type Layout, type Orientation } from "./layout";
import { Minimap } from "./minimap";
import { edgePath, paint } from "./paint";

const CLICK_SLACK = 4;
const READABLE = 0.9;
const NARROW = 600;

export class GraphView {
  readonly camera = new Camera();
  layout: Layout | null = null;
  following = true;
  found: ReadonlySet<number> = new Set();
  private edges = new Path2D();
  private hovered = -1;
  private due = 0;
  private fitted = false;
  private besideBefore = false;
  private followed = -1;
  private readonly minimap: Minimap;
  private readonly pointers = new Map<number, { x: number; y: number }>();
  private moved = 0;
  private readonly watching: ResizeObserver;

  constructor(
    private readonly run: Run,
    private readonly host: HTMLElement,
    private readonly canvas: HTMLCanvasElement,
    map: HTMLCanvasElement,
    private readonly marker: () => HTMLElement | null,
    private readonly stopFollowing: () => void,
    private readonly beside: () => boolean,
  ) {
    this.minimap = new Minimap(map);
    this.watching = new ResizeObserver(() => this.resize());
    this.watching.observe(host);
    canvas.addEventListener("wheel", this.wheel, { passive: false });
    canvas.addEventListener("pointerdown", this.down);
    canvas.addEventListener("pointermove", this.move);
    canvas.addEventListener("pointerup", this.up);
    canvas.addEventListener("pointercancel", this.up);
    canvas.addEventListener("pointerleave", () => this.hover(-1));
    canvas.addEventListener("dblclick", this.fold);
    const jump = (event: PointerEvent): void => {
      if (event.buttons === 0) return;
      this.stopFollowing();
      this.camera.centre(...this.minimap.point(event), 0);
      this.redraw();
    };
    map.addEventListener("pointerdown", jump);
    map.addEventListener("pointermove", jump);
    this.resize();
  }

  close(): void {
    this.watching.disconnect();
    cancelAnimationFrame(this.due);
    this.layout = null;
  }

  relayout(orientation: Orientation): void {
    const tree = this.run.tree.peek();
    if (tree === null || tree.nodes.length === 0) return;
    const anchor = this.layout?.byIndex.get(Math.max(0, this.run.selected.peek()));
    const before = anchor === undefined ? null : { x: anchor.x, y: anchor.y, index: anchor.index };
    const turned = this.layout !== null && this.layout.orientation !== orientation;
    this.layout = layOut(tree, this.run.collapsed.peek(), orientation);
    this.edges = edgePath(this.layout, this.layout.cards);
    const after = before === null ? undefined : this.layout.byIndex.get(before.index);
    if (!this.fitted || turned) this.open();
    else if (after !== undefined && (before!.x !== after.x || before!.y !== after.y)) {
      this.camera.pan((before!.x - after.x) * this.camera.zoom, (before!.y - after.y) * this.camera.zoom);
    }
    this.redraw();
  }

  /** The first view: the whole tree where it stays readable or is to be compared, else its root at a readable size. */
  private open(): void {
    if (this.layout === null || this.camera.width < 10) return;
    this.fitted = true;
    this.besideBefore = this.beside();
    this.camera.fit(this.layout, 0);
    if (this.camera.zoom >= 0.62 || this.beside()) return;
    const root = this.layout.cards[0]!;
    const right = this.layout.orientation === "right";
    this.camera.centre(root.x, root.y, 0, 0.85);
    this.camera.pan(right ? 28 - this.camera.width / 2 : 0, right ? 0 : 28 - this.camera.height / 2);
    this.followed = -1;
    this.follow();
  }

  fit(): void {
    if (this.layout !== null) this.camera.fit(this.layout, performance.now());
    this.redraw();
  }

  zoom(factor: number): void {
    this.camera.zoomAt(this.camera.width / 2, this.camera.height / 2, factor);
    this.redraw();
  }

  panBy(dx: number, dy: number): void {
    this.camera.pan(dx, dy);
    this.redraw();
  }

  /** Brings a card into view, enlarged where it could not be read. */
  reveal(index: number): void {
    const card = this.shownCard(index);
    if (card === undefined) return;
    if (this.camera.zoom < READABLE * 0.6) {
      this.camera.centre(card.x + card.width / 2, card.y + CARD_HEIGHT / 2, performance.now(), READABLE);
    } else this.camera.reveal(boxOf(card), 24, performance.now());
    this.redraw();
  }

  /** Keeps what runs in view, if asked to; called at each change. */
  follow(): void {
    if (!this.following || this.layout === null) return;
    const leaf = this.run.runningLeaves()[0];
    if (leaf === undefined || leaf === this.followed) return;
    this.followed = leaf;
    const card = this.shownCard(leaf);
    if (card !== undefined) this.camera.reveal(boxOf(card), 60, performance.now());
  }

  /** The card of a node, or of the folded one that hides it. */
  private shownCard(index: number): Card | undefined {
    const cards = this.layout?.byIndex;
    const hiding = this.run.tree.peek()?.ancestors(index) ?? [];
    return cards?.get(index) ?? cards?.get(hiding.find((ancestor) => cards.has(ancestor)) ?? -1);
  }

  redraw(): void {
    this.due ||= requestAnimationFrame((now) => {
      this.due = 0;
      this.draw(now);
    });
  }

  private draw(now: number): void {
    const tree = this.run.tree.peek();
    if (tree === null || this.layout === null || this.camera.width < 10) return;
    const context = this.canvas.getContext("2d")!;
    const moving = this.camera.advance(now);
    const paused = this.run.paused.peek();
    const glowing = paint(
      context,
      this.camera,
      {
        tree,
        layout: this.layout,
        states: this.run.states,
        results: this.run.results,
        changedAt: this.run.changedAt,
        selected: this.run.selected.peek(),
        hovered: this.hovered,
        found: this.found,
        breakpoints: new Set(this.run.breakpoints.peek().map((point) => tree.indexOf(point.node))),
        stopped: paused?.reason === "breakpoint" ? tree.find(paused.node) : -1,
      },
      this.edges,
      palette.peek(),
      now,
    );
    const behind = this.camera.width >= NARROW && this.minimap.paint(this.layout, this.run.states, this.camera, palette.peek(), now);
    this.placeMarker();
    if (moving || glowing || behind) this.redraw();
  }

  /** The focused tree item lies over its card, so that magnifiers and focus rings find it. */
  private placeMarker(): void {
    const marker = this.marker();
    const card = this.layout?.byIndex.get(Number(marker?.dataset["index"] ?? -1));
    if (marker === null || card === undefined) return;
    const { x, y, zoom } = this.camera;
    marker.style.width = `${card.width * zoom}px`;
    marker.style.height = `${CARD_HEIGHT * zoom}px`;
    marker.style.transform = `translate(${card.x * zoom + x}px, ${card.y * zoom + y}px)`;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.host;
    if (clientWidth === 0 || clientHeight === 0) return;
    const wasWhole = this.layout !== null && within(this.layout, this.camera.seen());
    this.camera.resize(clientWidth, clientHeight);
    this.canvas.width = Math.round(clientWidth * devicePixelRatio);
    this.canvas.height = Math.round(clientHeight * devicePixelRatio);
    const lost = this.layout !== null && !(wasWhole ? within : meet)(this.layout, this.camera.seen());
    if (!this.fitted || this.besideBefore !== this.beside() || lost) this.open();
    this.draw(performance.now());
  }

  private cardAt(event: MouseEvent): Card | undefined {
    const box = this.canvas.getBoundingClientRect();
    const [x, y] = this.camera.toDrawing(event.clientX - box.left, event.clientY - box.top);
    return this.layout?.cards.find((card) => x >= card.x && x <= card.x + card.width && y >= card.y && y <= card.y + CARD_HEIGHT);
  }

  private hover(index: number): void {
    if (index === this.hovered) return;
    this.hovered = index;
    const node = this.run.tree.peek()?.nodes[index];
    this.canvas.title = node === undefined ? "" : `${node.name} (${node.type})`;
    this.canvas.classList.toggle("over-card", index >= 0);
    this.redraw();
  }

  private readonly wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    this.stopFollowing();
    if (event.shiftKey) this.camera.pan(-event.deltaY - event.deltaX, 0);
    else this.camera.zoomAt(event.clientX - box.left, event.clientY - box.top, Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)));
    this.redraw();
  };

  private readonly down = (event: PointerEvent): void => {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.moved = 0;
  };

  private readonly move = (event: PointerEvent): void => {
    const last = this.pointers.get(event.pointerId);
    if (last === undefined) {
      this.hover(this.cardAt(event)?.index ?? -1);
      return;
    }
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
    const other = others[0];
    const dx = event.clientX - last.x;
    const dy = event.clientY - last.y;
    this.moved += Math.abs(dx) + Math.abs(dy);
    if (other !== undefined) {
      const before = Math.hypot(last.x - other.x, last.y - other.y);
      const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
      const box = this.canvas.getBoundingClientRect();
      this.camera.zoomAt((event.clientX + other.x) / 2 - box.left, (event.clientY + other.y) / 2 - box.top, after / Math.max(1, before));
      this.camera.pan(dx / 2, dy / 2);
    } else if (this.moved > CLICK_SLACK) this.camera.pan(dx, dy);
    if (this.moved > CLICK_SLACK) this.stopFollowing();
    last.x = event.clientX;
    last.y = event.clientY;
    this.redraw();
  };

  private readonly up = (event: PointerEvent): void => {
    const clicked = event.type === "pointerup" && this.pointers.size === 1 && this.moved <= CLICK_SLACK;
    this.pointers.delete(event.pointerId);
    if (!clicked) return;
    const card = this.cardAt(event);
    this.run.selected.value = card?.index ?? -1;
    this.host.focus();
  };

  private readonly fold = (event: MouseEvent): void => {
    const index = this.cardAt(event)?.index ?? -1;
    if (index >= 0) this.run.fold(index, !this.run.collapsed.peek().has(index));
  };
}

function within(inner: Box, outer: Box): boolean {
  return inner.left >= outer.left && inner.top >= outer.top && inner.right <= outer.right && inner.bottom <= outer.bottom;
}

function meet(one: Box, other: Box): boolean {
  return one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
}

function boxOf(card: Card): Box {
  return { left: card.x, top: card.y, right: card.x + card.width, bottom: card.y + CARD_HEIGHT };
}
