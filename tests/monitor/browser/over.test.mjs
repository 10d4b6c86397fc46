// Runs that are over: where they open, what they say of themselves, how they are told apart; and two of them beside each other.

import assert from "node:assert/strict";
import { test } from "node:test";
import { errand, eventually, open } from "./harness.mjs";

/** Three seconds of the errand; `failure` at one second, if any. */
function over(id, outcome, { failure = null, ...about } = {}) {
  const run = errand(id);
  for (let i = 0; i < 60; i++) run.tick();
  run.end(outcome);
  Object.assign(run.about, about);
  run.marks = run.marks.filter((mark) => mark.kind === "end");
  if (failure !== null) {
    run.marks.unshift({ time: 1, kind: "error", text: failure });
    run.log.push({ time: 1, level: "error", node: leaf(run).path, code: "not_held", message: failure, logger: "tree",
      where: "grasp (fetch.xml:12)" });
  }
  return run;
}

function leaf(run) {
  return run.tree.records.find((record) => record.category === "action");
}

const moment = (page) => page.getByRole("slider", { name: "Moment of the run" }).getAttribute("aria-valuenow");

test("a run that failed opens at its first failure, and says how it came out and why", async () => {
  const run = over("failed", "failure", { failure: "the cup slipped" });
  const { page } = await open([run]);
  await eventually(() => moment(page), "1");
  const told = page.getByRole("region", { name: "How it came out" });
  await told.getByText("failure", { exact: true }).waitFor();
  await told.getByText("the cup slipped").waitFor();
  await told.getByRole("button", { name: "Show grasp (fetch.xml:12)" }).click();
  await page.locator(".node-name", { hasText: leaf(run).name }).waitFor();
});

test("a run without a failure opens at its end", async () => {
  const { page } = await open([over("good", "success")]);
  await eventually(() => moment(page), "3");
  assert.equal(await page.locator(".ending .why").count(), 0);
});

test("work that is over has the colour of what it came to, and is called by it", async () => {
  const run = over("told", "failure");
  const { uid } = leaf(run);
  run.openSpans.clear();
  run.spans = [
    { uid, state: 1, from: 0, to: 1 }, { uid, state: 3, from: 1, to: 1.05 },
    { uid, state: 1, from: 1.1, to: 2 },
  ];
  const { page } = await open([run]);
  const box = await page.getByRole("slider").boundingBox();
  const at = (time) => 12 + (time / 3) * (box.width - 28);
  const tip = async (time) => {
    await page.mouse.move(box.x + at(time), box.y + 39);
    return page.locator(".tip").innerText();
  };
  await eventually(async () => (await tip(0.3)).split(": ").at(-1), "failure");
  await eventually(async () => (await tip(1.8)).split(": ").at(-1), "halted");
  const painted = await page.getByRole("slider").evaluate((canvas, x) => {
    const [r, g, b] = canvas.getContext("2d").getImageData(Math.round(x), 44, 1, 1).data;
    const wanted = getComputedStyle(document.documentElement).getPropertyValue("--failure").trim();
    return [r, g, b].every((value, i) => Math.abs(value - parseInt(wanted.slice(1 + 2 * i, 3 + 2 * i), 16)) < 30);
  }, at(0.6));
  assert.ok(painted);
});

test("the list tells folder and start, and a run that was broken off has a shape of its own", async () => {
  const broken = over("broken", "failure", { folder: "/data/runs/20260304_errand_seed1" });
  [broken.state, broken.outcome, broken.started] = ["interrupted", null, new Date(2026, 2, 4, 5, 6, 7).getTime() / 1000];
  const { page } = await open([broken, over("failed", "failure")]);
  await page.locator(".run-button").click();
  const line = page.locator(".run-line", { hasText: "interrupted" });
  await line.getByText("20260304_errand_seed1").waitFor();
  await line.getByText(/2026-03-04 05:06:07/).waitFor();
  const shapes = await page.locator(".run-line .shape").evaluateAll((found) => found.map((shape) => shape.innerHTML));
  assert.equal(new Set(shapes).size, 2);
});

test("beside another run both trees are seen whole, without map and legend, and the panel says of which run it speaks", async () => {
  const { page } = await open([over("a", "success"), over("b", "success")], { width: 1280 });
  await page.locator(".run-button").click();
  await page.locator(".run-line").first().click();
  await page.locator(".legend").waitFor();
  await page.locator(".run-button").click();
  await page.getByRole("button", { name: /Compare with/ }).first().click();
  await page.locator(".tree-pane").nth(1).waitFor();
  await eventually(() => page.locator(".minimap:visible, .legend:visible").count(), 0);
  await page.getByRole("complementary", { name: "Details of run A" }).waitFor();
  await page.locator(".tree-pane").nth(1).click({ position: { x: 60, y: 20 } });
  await page.getByRole("complementary", { name: "Details of run B" }).waitFor();
  assert.equal(await page.locator(".tabs .letter").innerText(), "B");
});

test("on a phone what is told of two runs side by side lies each in the pane of its run", async () => {
  const { page } = await open([over("a", "success"), over("b", "success")], { width: 400, height: 740 });
  await page.locator(".run-button").click();
  await page.locator(".run-line").first().click();
  await page.locator(".run-button").click();
  await page.getByRole("button", { name: /Compare with/ }).first().click();
  await page.locator(".phone-tabs").getByRole("button", { name: "Tree" }).click();
  await page.locator(".tree-pane").nth(1).waitFor();
  const outside = await page.$$eval(".tree-bar > *", (parts) => parts
    .filter((part) => part.getClientRects().length > 0)
    .filter((part) => part.getBoundingClientRect().right > part.parentElement.getBoundingClientRect().right + 0.5)
    .map((part) => part.outerHTML.slice(0, 80)));
  assert.deepEqual(outside, []);
});

test("an empty text and an entry without a value are told apart", async () => {
  const run = errand();
  const empty = { type: "string", text: "", changed_at: 0 };
  run.blackboard = { "": { said: { ...empty, value: "" }, unset: { ...empty, value: null } } };
  run.tick();
  const { page } = await open([run]);
  await page.keyboard.press("2");
  await eventually(() => page.locator("tr[data-key=said] .value").innerText(), '""');
  await eventually(() => page.locator("tr[data-key=unset] .value").innerText(), "none");
});
