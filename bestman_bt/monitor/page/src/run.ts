// What the page knows about one opened run. Its memory is bounded: the history stays on the server.

import { signal } from "@preact/signals";
import { JointHistory, Trail } from "./bounded";
import { IDLE, RUNNING } from "./states";
import { Tree } from "./tree";
import type {
  Breakpoint, DeltaMessage, Entry, LogLine, MapRecord, Mark, Paused, RobotRecord, ScanRecord, Scopes,
  Span, StateMessage, Statistics, TreeMessage,
} from "./protocol";

const MOST_LOG_LINES = 2000;
const MOST_PICTURES = 60;
const UNFOLDED_NODES = 130;
const SLOW_BEAT = 120;

export interface Picture {
  camera: string;
  time: number;
  url: string;
}

export class Run {
  readonly tree = signal<Tree | null>(null);
  /** Counts what came; canvases follow it and draw at the next frame. */
  readonly frame = signal(0);
  /** Beats at most about eight times a second; panels of text follow it. */
  readonly beat = signal(0);
  readonly live = signal(true);
  readonly paused = signal<Paused | null>(null);
  readonly breakpoints = signal<Breakpoint[]>([]);
  readonly log = signal<LogLine[]>([]);
  readonly pictures = signal<Picture[]>([]);
  readonly map = signal<MapRecord | null>(null);
  readonly timeline = signal<{ spans: Span[]; marks: Mark[]; last: number }>({ spans: [], marks: [], last: 0 });
  readonly selected = signal(-1);
  readonly collapsed = signal<ReadonlySet<number>>(new Set());

  time = 0;
  tick = 0;
  first = 0;
  last = 0;
  states = new Uint8Array(0);
  /** What each node last returned since it last started: quick conditions are idle again before anyone sees them. */
  results = new Uint8Array(0);
  /** Page's clock in milliseconds at the last change of each node, for the glow. */
  changedAt = new Float64Array(0);
  messages = new Map<number, string>();
  statistics = new Map<number, Statistics>();
  blackboard: Scopes<Entry> = {};
  robot: RobotRecord = {};
  scan: ScanRecord | null = null;
  path: [number, number][] = [];
  readonly trail = new Trail();
  readonly joints = new JointHistory();

  /** Whether a moment to begin with has been chosen. */
  opened = false;

  private beatDue = 0;

  constructor(readonly id: string) {}

  takeTree(message: TreeMessage): void {
    const before = this.tree.value;
    const tree = new Tree(message.nodes);
    this.states = grown(this.states, tree.nodes.length);
    this.results = grown(this.results, tree.nodes.length);
    this.changedAt = new Float64Array(tree.nodes.length).fill(-Infinity);
    this.tree.value = tree;
    // Nodes may come while the run goes on, below those that were there: what the person chose and folded stays.
    if (before === null || before.nodes.some((node, i) => node.path !== tree.nodes[i]?.path)) {
      this.collapsed.value = tree.folded(UNFOLDED_NODES);
      this.selected.value = -1;
    }
    if (message.map) this.map.value = message.map;
    this.first = message.first ?? this.first;
    this.last = Math.max(this.last, message.last ?? 0);
    this.changed();
  }

  takeState(message: StateMessage): void {
    const jumped = message.time < this.time || !message.live || !this.live.value;
    this.live.value = message.live;
    const results = message.results?.["0"] ?? [];
    message.states["0"].forEach((state, i) => this.setState(i + 1, state, results[i] ?? 0));
    if (jumped) this.changedAt.fill(-Infinity);
    this.trail.clear();
    for (const [x, y] of message.driven ?? []) this.trail.add(x, y);
    this.first = message.first ?? this.first;
    this.last = message.last ?? this.last;
    this.messages.clear();
    this.statistics.clear();
    this.blackboard = message.blackboard ?? {};
    this.robot = {};
    this.scan = null;
    this.path = [];
    this.paused.value = message.paused ?? null;
    this.breakpoints.value = message.breakpoints ?? this.breakpoints.value;
    this.takeRest(message);
  }

  takeDelta(message: DeltaMessage): void {
    if (message.paused !== undefined) this.paused.value = message.paused;
    if (message.breakpoints !== undefined) this.breakpoints.value = message.breakpoints;
    if (!this.live.value) return;
    for (const [uid, state, , result] of message.changes ?? []) this.setState(uid, state, result);
    for (const [scope, entries] of Object.entries(message.blackboard ?? {})) {
      const known = (this.blackboard[scope] ??= {});
      for (const [key, entry] of Object.entries(entries)) {
        if (entry === null) delete known[key];
        else known[key] = { ...entry, changed_at: entry.changed_at ?? message.time };
      }
    }
    this.takeRest(message);
  }

  private takeRest(message: StateMessage | DeltaMessage): void {
    this.time = message.time;
    this.tick = message.tick;
    this.last = Math.max(this.last, message.time);
    for (const [uid, text] of Object.entries(message.messages ?? {})) this.messages.set(this.index(uid), text);
    for (const [uid, numbers] of Object.entries(message.statistics ?? {})) this.statistics.set(this.index(uid), numbers);
    if (message.robot) {
      this.robot = { ...this.robot, ...message.robot };
      if (message.robot.base) this.trail.add(message.robot.base[0], message.robot.base[1]);
      if (this.live.value) this.joints.add(message.robot.time ?? message.time, message.robot.joints ?? {});
    }
    if (message.scan) this.scan = message.scan;
    if (message.path) this.path = message.path;
    this.changed();
  }

  takeExtent(first: number, last: number): void {
    this.first = first;
    this.last = last;
    this.changed();
  }

  takeLog(lines: LogLine[], reset: boolean): void {
    this.log.value = [...(reset ? [] : this.log.value), ...lines].slice(-MOST_LOG_LINES);
  }

  takePicture(picture: Picture): void {
    if (this.pictures.value.some((known) => known.url === picture.url)) return;
    this.pictures.value = [...this.pictures.value, picture].slice(-MOST_PICTURES);
  }

  takeTimeline(first: number, last: number, spans: Span[], marks: Mark[]): void {
    this.timeline.value = { spans, marks, last };
    this.takeExtent(first, Math.max(last, this.live.value ? this.time : last));
  }

  /** What one wants to see first of a run that is over: its first failure, else its end. */
  get telling(): number {
    const failure = this.timeline.peek().marks.find((mark) => ["error", "failure", "warning"].includes(mark.kind));
    return failure?.time ?? this.last;
  }

  /** Why a run that is over did not succeed: the last failure that its log tells. */
  get lastFailure(): LogLine | undefined {
    return this.log.value.findLast((line) => line.node && (line.level === "error" || line.level === "warning"));
  }

  /** The state to show: an idle node that was reset after it returned shows that, faintly (see `isFaint`). */
  shownState(index: number): number {
    return this.states[index] || this.results[index] || IDLE;
  }

  isFaint(index: number): boolean {
    return this.states[index] === IDLE && this.results[index] !== 0;
  }

  /** The deepest nodes that run now, in drawing order. */
  runningLeaves(): number[] {
    const tree = this.tree.peek();
    if (tree === null) return [];
    return tree.nodes
      .filter((node) => this.states[node.index] === RUNNING
        && !node.children.some((child) => this.states[child] === RUNNING))
      .map((node) => node.index);
  }

  fold(index: number, folded: boolean): void {
    const next = new Set(this.collapsed.value);
    if (folded && this.tree.value?.nodes[index]?.children.length) next.add(index);
    else next.delete(index);
    this.collapsed.value = next;
  }

  /** Selects a node and opens what hides it. */
  show(index: number): void {
    const hidden = this.tree.value?.ancestors(index).filter((ancestor) => this.collapsed.value.has(ancestor)) ?? [];
    if (hidden.length > 0) {
      const next = new Set(this.collapsed.value);
      hidden.forEach((ancestor) => next.delete(ancestor));
      this.collapsed.value = next;
    }
    this.selected.value = index;
  }

  private index(uid: string): number {
    return this.tree.peek()?.indexOf(Number(uid)) ?? -1;
  }

  private setState(uid: number, state: number, result: number): void {
    const index = this.tree.peek()?.indexOf(uid) ?? -1;
    if (index < 0 || (this.states[index] === state && this.results[index] === result)) return;
    this.states[index] = state;
    this.results[index] = result;
    this.changedAt[index] = performance.now();
  }

  private changed(): void {
    this.frame.value++;
    this.beatDue ||= window.setTimeout(() => {
      this.beatDue = 0;
      this.beat.value++;
    }, SLOW_BEAT);
  }
}

function grown(values: Uint8Array, length: number): Uint8Array<ArrayBuffer> {
  const longer = new Uint8Array(length);
  longer.set(values.subarray(0, length));
  return longer;
}
