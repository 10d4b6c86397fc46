// A real browser before a scripted server. Whatever a page writes to its console as an error fails the test that opened it.

import assert from "node:assert/strict";
import { after, afterEach, before } from "node:test";
import { FakeRun } from "./fake_run.mjs";
import { FakeServer, PACKAGES } from "./fake_server.mjs";
import { steps } from "./scripted_trees.mjs";

const { chromium } = PACKAGES("playwright-core");
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
const PATIENCE = 60_000; // ms; reached only on a busy machine, or where the page is wrong
const SETTLES = 3_000; // ms

let browser;
let opened = [];

before(async () => {
  // Containers have neither the user namespaces nor the shared memory that the sandbox and the GPU process want.
  browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"] });
});

after(() => browser.close());

afterEach(async () => {
  const errors = opened.flatMap(({ errors: found }) => found);
  for (const { context, server } of opened) {
    await context.close();
    await server?.stop();
  }
  opened = [];
  assert.deepEqual(errors, [], "the page wrote errors to its console");
});

/** The run of ten nodes whose ticks the test gives. */
export function errand(id = "errand", options = {}) {
  return new FakeRun(id, steps(), { task: "errand", tree: "errand", robot: "diff_panda", scene: "kitchen" }, options);
}

/** Serves the runs and opens the page; `allowed` are console errors that the test provokes. */
export async function open(runs, { port = 0, readOnly = false, ...options } = {}) {
  const server = await new FakeServer(runs, { readOnly }).start(port);
  const record = await visit(server.url, server, options);
  return { page: record.page, server, record };
}

/** Opens the page of any server. */
export async function look(url, options = {}) {
  return (await visit(url, null, options)).page;
}

async function visit(url, server, { width = 1440, height = 900, theme = "light", allowed = null, motion = "reduce" }) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: theme, reducedMotion: motion });
  context.setDefaultTimeout(PATIENCE);
  const page = await context.newPage();
  const record = { page, context, server, errors: [] };
  page.on("console", (message) => {
    if (message.type() === "error" && !(allowed?.test(message.text()) ?? false)) record.errors.push(message.text());
  });
  page.on("pageerror", (error) => record.errors.push(String(error)));
  opened.push(record);
  await page.goto(url);
  await settled(page);
  return record;
}

/** Waits until the page listens to its keys: a run is open, or, where none is, a moment has passed. */
async function settled(page) {
  const open = page.getByRole("tab").first();
  await open.waitFor({ timeout: SETTLES }).catch(() => undefined);
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

/** Waits until `read` gives `expected`; the message of a failure tells what it gave at last. */
export async function eventually(read, expected, what) {
  const deadline = Date.now() + PATIENCE;
  let found;
  do {
    found = await read();
    try {
      assert.deepEqual(found, expected);
      return;
    } catch {
      await new Promise((resolve) => setTimeout(resolve, 30));
    }
  } while (Date.now() < deadline);
  assert.deepEqual(found, expected, what);
}

/** Name → state, as the outline tells them. */
export async function shownStates(page) {
  return page.$$eval(".outline-row", (rows) =>
    Object.fromEntries(rows.map((row) => [row.querySelector(".row-name").textContent, Number(row.dataset.state)])));
}

/** The same, as the executor has them. */
export function trueStates(run) {
  return Object.fromEntries(run.tree.records.map((record) => [record.name, run.tree.states[record.uid]]));
}

export async function chooseNode(page, name) {
  await page.fill("input[type=search]", name);
  await page.press("input[type=search]", "Enter");
  await page.locator(".node-name", { hasText: name }).waitFor();
}
