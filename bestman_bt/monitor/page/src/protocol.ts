// What the server and the page tell each other over the WebSocket; docs/monitoring.md describes it.

export type RunKind = "live" | "recorded";
export type RunState = "running" | "paused" | "ended" | "lost" | "interrupted";

export interface RunSummary {
  id: string;
  kind: RunKind;
  task?: string | null;
  tree?: string | null;
  scene?: string | null;
  robot?: string | null;
  seed?: number | null;
  pid?: number | null;
  folder?: string | null;
  state: RunState;
  outcome?: string | null;
  time?: number | null;
  ticks?: number | null;
  started?: number | null;
  /** Of a process that is not ours: it is only watched, and begins anew as another run. */
  source?: string | null;
}

export type Category = "action" | "condition" | "control" | "decorator" | "subtree";

export interface NodeRecord {
  uid: number;
  parent: number | null;
  name: string;
  type: string;
  category: Category;
  path: string;
  ports?: Record<string, string>;
  scope?: string;
  /** Its code is not here: it stands for a node of another process. */
  placeholder?: boolean;
}

export interface Polygon {
  name: string;
  polygon: [number, number][];
}

export interface MapRecord {
  resolution: number;
  origin: [number, number];
  width: number;
  height: number;
  /** Base64 of a grid, dark where it is occupied, its first row at the greatest y; empty where there is none. */
  png?: string;
  furniture?: Polygon[];
  /** Segments x1, y1, x2, y2. */
  walls?: [number, number, number, number][];
}

export interface RobotRecord {
  time?: number;
  base?: [number, number, number];
  believed_std?: [number, number];
  joints?: Record<string, number>;
  velocities?: Record<string, number>;
  efforts?: Record<string, number>;
  held?: string | null;
  diagnostics?: unknown;
  /** The share of its speed at which an operator lets it move. */
  speed?: number;
}

export interface ScanRecord {
  time?: number;
  base?: [number, number, number];
  points: [number, number][];
}

export interface Entry {
  type: string;
  text: string;
  /** Where it is plain and short. */
  value?: unknown;
  changed_at?: number;
}

export type Scopes<T> = Record<string, Record<string, T>>;

export interface Paused {
  time?: number;
  reason: "asked" | "breakpoint" | "confirm";
  node?: number | string | null;
  when?: "before" | "after";
  /** Of a motion that waits to be confirmed, and the outlines of what it passes through, in the map frame. */
  words?: string;
  swept?: [number, number][][];
}

export interface Breakpoint {
  node: number;
  when: "before" | "after";
  condition?: string | null;
  once?: boolean;
}

/** Starts, successes, failures, seconds running. */
export type Statistics = [number, number, number, number];

/** The result is what the node last returned since it last started; 0 for nothing. Inner trees are part of tree 0. */
export type Change = [uid: number, state: number, tree: 0, result: number];

export interface TreeMessage {
  type: "tree";
  id: string;
  nodes: NodeRecord[];
  duration?: number;
  first?: number;
  last?: number;
  map?: MapRecord | null;
}

interface Snapshot {
  id: string;
  time: number;
  tick: number;
  messages?: Record<string, string>;
  statistics?: Record<string, Statistics>;
  robot?: RobotRecord | null;
  scan?: ScanRecord | null;
  path?: [number, number][] | null;
  paused?: Paused | null;
  breakpoints?: Breakpoint[];
}

export interface StateMessage extends Snapshot {
  type: "state";
  live: boolean;
  first?: number;
  last?: number;
  /** Indexed by uid - 1. */
  states: { "0": number[] };
  results?: { "0": number[] };
  driven?: [number, number][];
  blackboard?: Scopes<Entry>;
}

export interface DeltaMessage extends Snapshot {
  type: "delta";
  changes?: Change[];
  blackboard?: Scopes<Entry | null>;
}

export interface LogLine {
  time: number;
  level: string;
  node?: string | number | null;
  code?: string | null;
  message: string;
  logger?: string | null;
  /** What people call the node: its name with file and line. */
  where?: string | null;
}

export interface Span {
  uid: number;
  state: number;
  from: number;
  to: number;
  /** Several, of which this is the state that matters most. */
  merged?: boolean;
}

export interface Mark {
  time: number;
  kind: string;
  text: string;
  node?: number | null;
}

export interface Parted {
  time_a: number;
  time_b: number;
  path: string;
  path_b?: string | null;
  state_a: number | null;
  state_b: number | null;
  words: string;
}

export type ServerMessage =
  | { type: "hello"; version: number; read_only: boolean; runs: RunSummary[] }
  | { type: "runs"; runs: RunSummary[] }
  | TreeMessage
  | ({ type: "map"; id: string } & MapRecord)
  | StateMessage
  | DeltaMessage
  | { type: "log"; id: string; lines: LogLine[]; reset?: boolean }
  | { type: "image"; id: string; camera: string; time: number; url: string }
  | { type: "series"; id: string; joints: Record<string, [number, number][]> }
  | { type: "timeline"; id: string; first: number; last: number; spans: Span[]; marks: Mark[] }
  | { type: "extent"; id: string; first: number; last: number }
  | { type: "comparison"; ids: [string, string]; parted: Parted | null; words: string }
  | { type: "answer"; for: number | null; ok: boolean; error?: string }
  | { type: "problem"; message: string };

export type Control =
  | { do: "pause" | "resume" | "step" | "decline" | "halt" | "stop" }
  | { do: "speed"; share: number }
  | { do: "set"; key: string; value: string; scope?: string }
  | ({ do: "breakpoint" } & Breakpoint)
  | { do: "clear_breakpoint"; node: number; when: "before" | "after" }
  | { do: "force"; node: number; result: "SUCCESS" | "FAILURE" };

export type Request =
  | { do: "open" | "close" | "live" | "timeline"; id: string }
  | { do: "seek"; id: string; time: number }
  | { do: "series"; id: string; joints: string[] }
  | { do: "compare"; ids: [string, string] }
  | (Control & { id: string; n: number });
