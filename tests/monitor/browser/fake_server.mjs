// Speaks the monitor's WebSocket protocol and serves the built page, with the real server's security headers.
// By hand: node fake_server.mjs [--nodes N] [--port 8750]; N = 0 fetches a cup.

import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { extname } from "node:path";
import { fileURLToPath } from "node:url";
import { FakeRun } from "./fake_run.mjs";
import { big, fetchCup } from "./scripted_trees.mjs";

export const PACKAGES = createRequire(new URL("../../../bestman_bt/monitor/page/package.json", import.meta.url));
const { WebSocketServer } = PACKAGES("ws");
const STATIC = new URL("../../../bestman_bt/monitor/static/", import.meta.url);
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".woff2": "font/woff2" };
export const CSP = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const PERIOD = 1000 / 30;
const PICTURE = `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 320 240"><rect width="320" height="240" fill="#8fa3b5"/><rect y="150" width="320" height="90" fill="#a9805a"/><path d="M130 90h60l-7 75h-46z" fill="#d9534f"/><path d="M190 105c30-6 30 40-4 38" fill="none" stroke="#d9534f" stroke-width="8"/></svg>`;

export class FakeServer {
  constructor(runs, { readOnly = false } = {}) {
    this.runs = runs;
    this.readOnly = readOnly;
    this.comparison = { parted: null, words: "the same outcomes" };
    this.clients = new Set();
    this.timers = [];
  }

  async start(port = 0) {
    this.http = createServer((request, response) => void this.#serve(request, response));
    this.sockets = new WebSocketServer({ server: this.http, path: "/ws" });
    this.sockets.on("connection", (socket) => this.#meet(socket));
    await new Promise((resolve) => this.http.listen(port, "127.0.0.1", resolve));
    this.port = this.http.address().port;
    this.url = `http://127.0.0.1:${this.port}/`;
    this.timers.push(setInterval(() => this.flush(), PERIOD));
    return this;
  }

  /** Ticks all runs by themselves, at their rates. */
  play() {
    for (const run of this.runs) if (run.kind === "live") this.timers.push(setInterval(() => run.tick(), 1000 / run.rate));
  }

  async stop() {
    this.timers.forEach(clearInterval);
    for (const client of this.clients) client.socket.terminate();
    this.sockets.close();
    this.http.closeAllConnections();
    await new Promise((resolve) => this.http.close(resolve));
  }

  /** Sends what is new, as the real server does 30 times a second. */
  flush() {
    const list = JSON.stringify(this.runs.map((run) => [run.id, run.state, run.outcome]));
    for (const run of this.runs) {
      const viewers = [...this.clients].filter((client) => client.open.has(run.id));
      if (viewers.length === 0 || run.told === run.version()) continue;
      run.told = run.version();
      const delta = run.deltaMessage();
      for (const client of viewers) {
        const at = client.open.get(run.id);
        if (at.seen === null) client.tell(delta);
        else client.tell({ type: "extent", id: run.id, first: run.history[0].time, last: run.time });
        if (run.log.length > at.lines) client.tell({ type: "log", id: run.id, lines: run.log.slice(at.lines) });
        run.images.slice(at.images).forEach((image) => client.tell(image));
        Object.assign(at, { lines: run.log.length, images: run.images.length });
      }
    }
    if (list !== this.list) this.#tellAll(() => ({ type: "runs", runs: this.runs.map((run) => run.summary()) }));
    this.list = list;
  }

  #tellAll(message) {
    for (const client of this.clients) client.tell(message());
  }

  #meet(socket) {
    const client = { socket, open: new Map(), tell: (message) => socket.send(JSON.stringify(message)) };
    this.clients.add(client);
    socket.on("close", () => this.clients.delete(client));
    socket.on("message", (text) => this.#asked(client, JSON.parse(text.toString())));
    client.tell({ type: "hello", version: 1, read_only: this.readOnly, runs: this.runs.map((run) => run.summary()) });
  }

  #asked(client, asked) {
    if (asked.do === "compare") {
      client.tell({ type: "comparison", ids: asked.ids, ...this.comparison });
      return;
    }
    const run = this.runs.find((candidate) => candidate.id === asked.id);
    if (run === undefined) {
      client.tell({ type: "problem", message: `there is no run '${asked.id}'` });
      return;
    }
    switch (asked.do) {
      case "open":
        client.open.set(run.id, { seen: null, lines: run.log.length, images: run.images.length });
        client.tell(run.treeMessage());
        client.tell(run.stateMessage());
        client.tell({ type: "log", id: run.id, lines: run.log.slice(-500), reset: true });
        run.images.forEach((image) => client.tell(image));
        return;
      case "close": client.open.delete(run.id); return;
      case "seek":
      case "live":
        client.open.get(run.id).seen = asked.do === "live" ? null : asked.time;
        client.tell(run.stateMessage(asked.do === "live" ? null : asked.time));
        return;
      case "timeline": client.tell(run.timelineMessage()); return;
      case "series": client.tell(run.seriesMessage(asked.joints)); return;
      default: {
        const error = this.readOnly ? "this monitor was started with --read-only: it only shows" : run.control(asked);
        client.tell({ type: "answer", for: asked.n, ok: error === null, ...(error === null ? {} : { error }) });
        this.flush();
      }
    }
  }

  async #serve(request, response) {
    const path = new URL(request.url, this.url).pathname;
    const headers = { "Content-Security-Policy": CSP, "X-Content-Type-Options": "nosniff" };
    if (/^\/runs\/.*\/images\//.test(path)) {
      response.writeHead(200, { ...headers, "Content-Type": "image/svg+xml" }).end(PICTURE);
      return;
    }
    const file = path === "/" ? "index.html" : path.slice(1);
    try {
      if (file.includes("..")) throw new Error("outside");
      const body = await readFile(new URL(file, STATIC));
      response.writeHead(200, { ...headers, "Content-Type": TYPES[extname(file)] ?? "text/plain" }).end(body);
    } catch {
      response.writeHead(404, headers).end("not found");
    }
  }
}

/** By hand, and for the benchmark. */
export function demonstration(nodes, rate = 20) {
  if (nodes > 0) return new FakeRun("big", big(nodes), { task: `patrol_${nodes}`, tree: "patrol", robot: "diff_panda", scene: "warehouse", endless: true }, { rate, history: 1500 });
  return new FakeRun("fetch", fetchCup(), { task: "fetch_cup", tree: "fetch_cup", robot: "diff_panda", scene: "apartment", seed: 7 }, { withRobot: true });
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const option = (name, otherwise) => (process.argv.includes(name) ? Number(process.argv[process.argv.indexOf(name) + 1]) : otherwise);
  const server = await new FakeServer([demonstration(option("--nodes", 0))]).start(option("--port", 8750));
  server.play();
  process.stdout.write(`${server.url}\n`);
}
