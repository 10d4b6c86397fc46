// The live page under load: 2,000 nodes ticked at 50 Hz before headless Chromium. Tells frames a second, memory over
// time, and with --near the latency from tick to pixel. Needs node, chromium and `npm ci --prefix bestman_bt/monitor/page`:
//   node benchmarks/monitor_page.mjs [--minutes 10] [--nodes 2000] [--rate 50] [--near]
// `--near` looks at readable cards instead of the whole tree, where cards are smaller than pixels. The latency holds the
// server's part, too: it sends 30 times a second.

import os from "node:os";
import { RUNNING, SUCCESS, leaf } from "../tests/monitor/browser/behavior_tree.mjs";
import { FakeRun } from "../tests/monitor/browser/fake_run.mjs";
import { FakeServer, PACKAGES } from "../tests/monitor/browser/fake_server.mjs";
import { big } from "../tests/monitor/browser/scripted_trees.mjs";

const { chromium } = PACKAGES("playwright-core");
const option = (name, otherwise) => (process.argv.includes(name) ? Number(process.argv[process.argv.indexOf(name) + 1]) : otherwise);
const minutes = option("--minutes", 10);
const nodes = option("--nodes", 2000);
const rate = option("--rate", 50);
const near = process.argv.includes("--near");
const BLINK = 25; // ticks between two changes of the node whose pixel is watched
const SETTLE = 5000;

/** The patrol with one node more, that turns from running to success and back. */
class BlinkingRun extends FakeRun {
  constructor() {
    const root = big(nodes);
    root.children.push(leaf("Beacon", { name: "beacon" }));
    super("patrol", root, { task: `patrol of ${nodes} nodes`, tree: "patrol", endless: true }, { rate, history: 600 });
    this.beacon = this.tree.records.at(-1).uid;
    this.blinks = [];
  }

  tick() {
    super.tick();
    if (this.ticks % BLINK === 0) {
      const state = (this.ticks / BLINK) % 2 === 0 ? RUNNING : SUCCESS;
      this.tree.states[this.beacon] = state;
      this.changes.set(this.beacon, [this.beacon, state, 0, 0]);
    }
    // The tree turns it, too, at the end of each round; all that is not success looks alike to the pixel.
    const state = this.tree.states[this.beacon] === SUCCESS ? SUCCESS : RUNNING;
    if (state !== this.blinks.at(-1)?.state) this.blinks.push({ at: Date.now(), state });
  }
}

function quantile(values, part) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))];
}

const run = new BlinkingRun();
const server = await new FakeServer([run]).start();
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"] });
const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
await page.goto(server.url);
await page.getByTestId("tick").waitFor();
await page.keyboard.press("w");
await page.keyboard.press("e");
await page.fill("input[type=search]", "beacon");
await page.press("input[type=search]", "Enter");
await page.locator(".node-name").waitFor();
await page.locator("[role=tree]").focus();
if (!near) await page.keyboard.press("f");
let changed = 0;
const late = { started: Date.now(), ticks: 0 };
// A timer of 20 ms drifts under load; ticks that are due are caught up, so that the rate is kept.
const ticking = setInterval(() => {
  while (late.ticks < ((Date.now() - late.started) / 1000) * rate) {
    late.ticks++;
    run.tick();
    changed += run.changes.size;
  }
}, 1000 / rate);
await page.waitForTimeout(SETTLE);

// In each frame, after the page has drawn: which colour the beacon's pixel has.
await page.evaluate(() => {
  const canvas = document.querySelector(".graph-host canvas");
  const context = canvas.getContext("2d");
  window.measured = { frames: [], seen: [] };
  let before = null;
  const look = () => {
    const now = performance.timeOrigin + performance.now();
    window.measured.frames.push(now);
    const box = document.querySelector("[role=treeitem][aria-selected=true]").getBoundingClientRect();
    const at = canvas.getBoundingClientRect();
    const x = Math.round(box.right - at.left - 5);
    const [, green, blue] = context.getImageData(x, Math.round(box.top - at.top + box.height / 2), 1, 1).data;
    const state = green > blue ? 2 : 1;
    if (before !== null && state !== before) window.measured.seen.push({ at: now, state });
    before = state;
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
});

const devtools = await page.context().newCDPSession(page);
const memory = [];
const [frames, seen] = [[], []];
const started = Date.now();
const end = started + minutes * 60_000;
while (Date.now() < end) {
  await page.waitForTimeout(Math.min(30_000, end - Date.now()));
  const part = await page.evaluate(() => {
    const { frames: f, seen: s } = window.measured;
    window.measured.frames = [];
    window.measured.seen = [];
    return { f, s };
  });
  for (const at of part.f) frames.push(at);
  seen.push(...part.s);
  await devtools.send("HeapProfiler.collectGarbage");
  const { usedSize } = await devtools.send("Runtime.getHeapUsage");
  memory.push({ minute: (Date.now() - started) / 60_000, megabytes: usedSize / 1e6 });
  run.blinks.splice(0, Math.max(0, run.blinks.length - 400));
  process.stderr.write(`${memory.at(-1).minute.toFixed(1)} min, heap ${memory.at(-1).megabytes.toFixed(1)} MB, ${part.f.length} frames, load ${os.loadavg()[0].toFixed(1)}\n`);
  for (const sight of part.s) {
    const cause = run.blinks.findLast((blink) => blink.state === sight.state && blink.at <= sight.at);
    if (cause !== undefined) sight.latency = sight.at - cause.at;
  }
}
clearInterval(ticking);

const seconds = new Map();
for (const at of frames) seconds.set(Math.floor(at / 1000), (seconds.get(Math.floor(at / 1000)) ?? 0) + 1);
const whole = [...seconds.values()].slice(1, -1);
const latencies = seen.map((sight) => sight.latency).filter((latency) => latency !== undefined);
const passed = (Date.now() - started) / 1000;
process.stdout.write(`${JSON.stringify({
  nodes: run.tree.records.length, rate, view: near ? "near" : "whole tree", minutes, cores: os.cpus().length, load: os.loadavg().map((value) => Number(value.toFixed(1))),
  ticks_per_second: Number((late.ticks / ((Date.now() - late.started) / 1000)).toFixed(1)), changes_per_second: Math.round(changed / passed),
  frames_per_second: { mean: Number((frames.length / passed).toFixed(1)), p5: quantile(whole, 0.05), least: Math.min(...whole) },
  latency_ms: near ? { samples: latencies.length, p50: Math.round(quantile(latencies, 0.5)), p95: Math.round(quantile(latencies, 0.95)), most: Math.round(Math.max(...latencies)) } : null,
  heap_mb: { first: Number(memory[0].megabytes.toFixed(1)), last: Number(memory.at(-1).megabytes.toFixed(1)), most: Number(Math.max(...memory.map((point) => point.megabytes)).toFixed(1)) },
}, null, 1)}\n`);
await browser.close();
await server.stop();
process.exit(0);
