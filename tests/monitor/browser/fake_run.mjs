// One scripted run as the monitor's server tells of it: history for scrubbing, robot, map, log, controls that act.

import { deflateSync } from "node:zlib";
import { FAILURE, RUNNING, SUCCESS, TickedTree } from "./behavior_tree.mjs";

const MOST_HISTORY = 6000;
const NAMES = ["IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED"];
const TABLE = [2.6, 1.1];
const SHELF = [-2.3, -1.4];

export class FakeRun {
  /** `about` is what the list of runs tells; `withRobot` adds map, scan, joints and pictures. */
  constructor(id, root, about = {}, { rate = 20, withRobot = false, kind = "live", history = MOST_HISTORY } = {}) {
    this.id = id;
    this.kind = kind;
    this.about = about;
    this.rate = rate;
    this.withRobot = withRobot;
    this.mostHistory = history;
    this.tree = new TickedTree(root);
    this.tree.hook = (node, at, result) => this.#happened(node, at, result);
    this.state = kind === "live" ? "running" : "ended";
    this.outcome = null;
    this.ticks = 0;
    this.time = 0;
    this.paused = null;
    this.breakpoints = [];
    this.received = [];
    this.blackboard = { "": { object: entry("string", "cup"), source: entry("string", "table"), target: entry("string", "shelf"), goal: entry("Pose", "x -2.30 y -1.40 z 0.92, yaw 1.57") } };
    this.log = [];
    this.images = [];
    this.marks = [];
    this.spans = [];
    this.openSpans = new Map();
    this.base = [-0.4, 0.2, 0];
    this.stand = TABLE;
    this.path = [];
    this.driven = [];
    this.held = null;
    this.speed = 1;
    this.arm = [0, -1.2, 0.9, 1.6, 0.3, 0.0];
    this.history = [];
    this.changes = new Map();
    this.started = Date.now() / 1000;
    this.#note("info", null, null, "run started");
    this.#remember();
  }

  summary() {
    return { id: this.id, kind: this.kind, scene: null, robot: null, seed: 1, pid: 4242, folder: null, ...this.about, state: this.state, outcome: this.outcome, time: this.time, ticks: this.ticks, started: this.started };
  }

  /** One tick of the execution, if nothing holds it. */
  tick(force = false) {
    if (this.state === "ended" || (this.paused !== null && !force)) return;
    this.ticks++;
    this.time = this.ticks / this.rate;
    const { result, changed } = this.tree.tick();
    for (const uid of changed) this.#span(uid);
    for (const uid of changed) this.changes.set(uid, [uid, this.tree.states[uid], 0, this.tree.results[uid]]);
    for (const record of this.tree.records) if (this.tree.states[record.uid] === RUNNING) this.tree.statistics[record.uid][3] += 1 / this.rate;
    this.#remember();
    const stop = this.breakpoints.find((point) => changed.includes(point.node) && this.tree.states[point.node] === RUNNING);
    if (stop !== undefined) this.pause({ time: this.time, reason: "breakpoint", node: stop.node, when: stop.when });
    if (result !== RUNNING && this.about.endless !== true) this.end(result === SUCCESS ? "success" : "failure");
  }

  pause(reason) {
    this.paused = reason;
    this.state = "paused";
    this.marks.push({ time: this.time, kind: "paused", text: reason.reason });
  }

  end(outcome) {
    this.state = "ended";
    this.outcome = outcome;
    this.paused = null;
    this.marks.push({ time: this.time, kind: "end", text: outcome });
    this.#note("info", null, null, `run ended: ${outcome}`);
  }

  /** Carries out a control; returns an error's words, or null. */
  control(asked) {
    this.received.push(asked);
    if (this.state === "ended") return "the execution has ended";
    switch (asked.do) {
      case "pause": this.pause({ time: this.time, reason: "asked", node: null, when: null }); return null;
      case "decline":
      case "resume": this.paused = null; this.state = "running"; return null;
      case "step": if (this.paused === null) return "pause first"; this.tick(true); return null;
      case "speed": this.speed = asked.share; return null;
      case "halt": this.end("cancelled"); return null;
      case "stop": this.end("cancelled"); return null;
      case "breakpoint": this.breakpoints = [...this.breakpoints, { node: asked.node, when: asked.when, condition: asked.condition, once: asked.once }]; return null;
      case "clear_breakpoint": this.breakpoints = this.breakpoints.filter((point) => point.node !== asked.node || point.when !== asked.when); return null;
      case "force": this.tree.forced.set(asked.node, NAMES.indexOf(asked.result)); return null;
      case "set":
        if (this.blackboard[asked.scope ?? ""]?.[asked.key] === undefined) return `there is no entry ${asked.key}`;
        if (asked.value === "refused") return `${asked.key}: 'refused' is no ${this.blackboard[asked.scope ?? ""][asked.key].type}`;
        this.set(asked.key, this.blackboard[asked.scope ?? ""][asked.key].type, asked.value, asked.scope);
        return null;
      default: return `unknown control ${asked.do}`;
    }
  }

  set(key, type, text, scope = "") {
    this.blackboard = { ...this.blackboard, [scope]: { ...this.blackboard[scope], [key]: entry(type, text, this.time) } };
    this.boardChanged = true;
  }

  /** Something that differs whenever there is something to tell. */
  version() {
    return JSON.stringify([this.ticks, this.state, this.paused, this.breakpoints, this.log.length, this.images.length, this.boardChanged]);
  }

  treeMessage() {
    return { type: "tree", id: this.id, nodes: this.tree.records, duration: this.time, first: this.history[0].time, last: this.time, map: this.withRobot ? MAP : null, scopes: Object.keys(this.blackboard) };
  }

  stateMessage(time = null) {
    const live = time === null;
    const at = live ? this.history.at(-1) : (this.history.findLast((moment) => moment.time <= time + 1e-9) ?? this.history[0]);
    return {
      type: "state", id: this.id, live: live && this.state !== "ended", first: this.history[0].time, last: this.time, states: { 0: [...at.states.slice(1)] }, results: { 0: [...at.results.slice(1)] },
      time: live ? this.time : Math.max(at.time, Math.min(time, this.time)), tick: at.tick, messages: at.messages, statistics: Object.fromEntries(this.tree.records.map(({ uid }) => [uid, this.tree.statistics[uid]])),
      blackboard: at.blackboard, robot: at.robot, scan: at.scan, path: at.path, driven: this.driven.filter((point) => point[2] <= at.time).map(([x, y]) => [x, y]),
      running: [], paused: live ? this.paused : null, breakpoints: this.breakpoints,
    };
  }

  /** What changed since the last call, merged. */
  deltaMessage() {
    const now = this.history.at(-1);
    const told = { type: "delta", id: this.id, time: this.time, tick: this.ticks, changes: [...this.changes.values()], messages: {}, paused: this.paused, breakpoints: this.breakpoints };
    for (const uid of this.changes.keys()) if (this.tree.messages[uid] !== undefined) told.messages[uid] = this.tree.messages[uid];
    told.statistics = Object.fromEntries([...this.changes.keys()].map((uid) => [uid, this.tree.statistics[uid]]));
    this.changes.clear();
    if (this.boardChanged) told.blackboard = this.blackboard;
    this.boardChanged = false;
    if (now.robot !== null) Object.assign(told, { robot: now.robot, scan: now.scan, path: now.path });
    return told;
  }

  timelineMessage() {
    const open = [...this.openSpans.values()].map((span) => ({ ...span, to: this.time }));
    return { type: "timeline", id: this.id, first: this.history[0].time, last: this.time, spans: [...this.spans, ...open], marks: this.marks };
  }

  seriesMessage(joints) {
    const found = Object.fromEntries(joints.map((name) => [name, []]));
    for (const moment of this.history.filter((_, i) => i % 4 === 0)) {
      for (const name of joints) if (moment.robot?.joints[name] !== undefined) found[name].push([moment.time, moment.robot.joints[name]]);
    }
    return { type: "series", id: this.id, joints: found };
  }

  #span(uid) {
    const state = this.tree.states[uid];
    const before = this.openSpans.get(uid);
    if (before !== undefined) {
      this.spans.push({ ...before, to: this.time });
      if (this.spans.length > 8000) this.spans.splice(0, 4000);
    }
    // Within one tick a node may return and be reset: what it returned is a moment of its own.
    if (before?.state === RUNNING && state === 0 && this.tree.results[uid] !== 0) this.spans.push({ uid, state: this.tree.results[uid], from: this.time, to: this.time });
    const node = this.tree.records[uid - 1];
    if (state === 0 || (node.category !== "action" && node.category !== "condition" && node.category !== "subtree")) this.openSpans.delete(uid);
    else this.openSpans.set(uid, { uid, state, from: this.time });
  }

  #note(level, node, code, message) {
    this.log.push({ time: this.time, level, node, code, message, logger: "bestman_bt" });
    if (level === "warning" || level === "error") this.marks.push({ time: this.time, kind: level, text: `${node}: ${message}` });
  }

  #happened(node, at, result) {
    const path = this.tree.records[node.uid - 1].path;
    if (result === FAILURE && node.category === "action") {
      const [code, words] = (node.why ?? "FAILED: it did not work").split(": ");
      this.#note("warning", path, code, words);
    } else if (result === SUCCESS && node.category === "action" && this.withRobot) this.#note("info", path, null, `${node.name} done`);
    if (at === 0 && this.withRobot) this.#note("debug", path, null, `${node.name} starts`);
    if (!this.withRobot) return;
    if (result === SUCCESS) {
      if (node.then === "stand") {
        this.stand = this.held === null ? TABLE : SHELF;
        this.set("stand", "Pose2D", `x ${this.stand[0].toFixed(2)} y ${this.stand[1].toFixed(2)}`, "fetch/pick");
      }
      if (node.then === "pose") this.set("pose", "Pose", "x 2.91 y 1.32 z 0.78, yaw 0.41", "fetch/pick");
      if (node.then === "grasps") this.set("grasps", "list of Grasp", "12 grasps, best 0.93", "fetch/pick");
      if (node.then === "grasp") this.held = "cup";
      if (node.then === "release") this.held = null;
      if (node.name === "DetectObject") this.images.push({ type: "image", id: this.id, camera: "head_camera", time: this.time, url: `runs/${this.id}/images/${this.images.length}.svg` });
    } else if (at >= 0) {
      if (node.then === "drive") this.#drive(at, node.ticks);
      else this.arm = this.arm.map((q, i) => q + 0.03 * Math.sin(this.time * (0.6 + 0.23 * i) + i));
    }
  }

  #drive(at, ticks) {
    if (at === 0) this.from = this.base;
    const part = (at + 1) / ticks;
    const bend = Math.sin(Math.PI * part) * 0.7;
    const [dx, dy] = [this.stand[0] - this.from[0], this.stand[1] - this.from[1]];
    const next = [this.from[0] + dx * part, this.from[1] + dy * part + bend];
    this.base = [next[0], next[1], Math.atan2(next[1] - this.base[1], next[0] - this.base[0])];
    this.path = Array.from({ length: 24 }, (_, i) => part + ((1 - part) * i) / 23).map((p) => [this.from[0] + dx * p, this.from[1] + dy * p + Math.sin(Math.PI * p) * 0.66]);
  }

  #remember() {
    const robot = !this.withRobot ? null : {
      time: this.time, base: this.base.map((value) => Number(value.toFixed(4))), believed_std: [0.021, 0.011], held: this.held, speed: this.speed, diagnostics: { battery: "78 %", "late ticks": 0 },
      joints: { ...Object.fromEntries(["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"].map((name, i) => [`arm_${name}`, this.arm[i]])), torso_lift: 0.31, finger_joint: this.held ? 0.031 : 0.08, left_wheel: this.time },
    };
    if (robot !== null) this.driven.push([...this.base.slice(0, 2), this.time]);
    this.history.push({ time: this.time, tick: this.ticks, states: Uint8Array.from(this.tree.states), results: Uint8Array.from(this.tree.results), messages: { ...this.tree.messages }, blackboard: this.blackboard, robot, scan: robot && this.ticks % 10 === 0 ? scanFrom(this.base) : (this.history.at(-1)?.scan ?? null), path: this.path });
    if (this.history.length > this.mostHistory) this.history.splice(0, 500);
  }
}

function entry(type, text, changed_at = 0) {
  return { type, text, changed_at };
}

const ROOM = { left: -4, right: 4, bottom: -3, top: 3 };
const FURNITURE = [
  { name: "table", polygon: [[2.4, 0.8], [3.6, 0.8], [3.6, 2.2], [2.4, 2.2]].map(([x, y]) => [x + 0.2, y + 0.4]) },
  { name: "shelf", polygon: [[-3.6, -2.2], [-2.6, -2.2], [-2.6, -0.8], [-3.6, -0.8]] },
  { name: "sofa", polygon: [[-1.2, 2.0], [0.9, 2.0], [0.9, 2.8], [-1.2, 2.8]] },
];
const MAP = { resolution: 0.05, origin: [-4.2, -3.2], width: 168, height: 128, png: mapPng(168, 128), furniture: FURNITURE, walls: [[0.4, -3, 0.4, -1.6]] };

function scanFrom([x, y]) {
  const points = [];
  for (let i = 0; i < 240; i++) {
    const angle = (i / 240) * 2 * Math.PI;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    let far = Math.min(c > 0 ? (ROOM.right - x) / c : (ROOM.left - x) / c, s > 0 ? (ROOM.top - y) / s : (ROOM.bottom - y) / s);
    for (let d = 0.2; d < far; d += 0.04) {
      const [px, py] = [x + c * d, y + s * d];
      if (FURNITURE.some(({ polygon }) => px > polygon[0][0] && px < polygon[2][0] && py > polygon[0][1] && py < polygon[2][1])) far = d;
    }
    const noise = 0.012 * Math.sin(i * 12.9898);
    points.push([Number((x + c * (far + noise)).toFixed(3)), Number((y + s * (far + noise)).toFixed(3))]);
  }
  return { base: [x, y, 0], points };
}

/** A grey PNG of the room: white inside, black walls, grey outside. */
function mapPng(width, height) {
  const rows = Buffer.alloc((width + 1) * height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const [x, y] = [-4.2 + (column + 0.5) * 0.05, 3.2 - (row + 0.5) * 0.05];
      const inside = x > ROOM.left && x < ROOM.right && y > ROOM.bottom && y < ROOM.top;
      const near = x > ROOM.left - 0.1 && x < ROOM.right + 0.1 && y > ROOM.bottom - 0.1 && y < ROOM.top + 0.1;
      rows[row * (width + 1) + 1 + column] = inside ? 254 : near ? 0 : 128;
    }
  }
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name, "latin1"), data]);
    const out = Buffer.alloc(body.length + 8);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeUInt32BE(crc(body), body.length + 4);
    return out;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header[8] = 8;
  return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", header), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]).toString("base64");
}

function crc(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) {
    value ^= byte;
    for (let bit = 0; bit < 8; bit++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  }
  return (value ^ 0xffffffff) >>> 0;
}
