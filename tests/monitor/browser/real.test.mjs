// The page before the real server and a real executor: what the buttons do reaches the tree.

import assert from "node:assert/strict";
import { afterEach, beforeEach, test } from "node:test";
import { fileURLToPath } from "node:url";
import { chooseNode, eventually, look, shownStates } from "./harness.mjs";
import { programs, START } from "./programs.mjs";

const EXECUTOR = fileURLToPath(new URL("real_executor.py", import.meta.url));
const world = programs();

async function monitored() {
  const monitor = world.start("-m", "bestman_bt.cli.main", "monitor", "--port", "0", "--no-browser");
  const executor = world.start(EXECUTOR);
  const url = /http\S+/.exec(await world.said(monitor, /http:/))[0];
  const page = await look(url);
  await page.getByRole("heading", { name: "errand", level: 1 }).waitFor({ timeout: START });
  await page.getByTestId("tick").waitFor();
  return { page, executor };
}

const ticks = (page) => page.getByTestId("tick").innerText().then((text) => Number(text.replace("tick ", "")));

beforeEach(() => world.begin());
afterEach(() => world.end());

test("states, pause, step, set, breakpoint, force and halt, on a real executor", async () => {
  const { page, executor } = await monitored();
  await page.keyboard.press("o");
  await eventually(async () => {
    const { errand, have_key: haveKey, again } = await shownStates(page);
    return { errand, haveKey, again };
  }, { errand: 1, haveKey: 2, again: 1 });

  await page.getByRole("button", { name: "Pause" }).click();
  await page.locator(".standing", { hasText: "Paused" }).waitFor();
  await page.waitForTimeout(300);
  const before = await ticks(page);
  await page.waitForTimeout(300);
  assert.equal(await ticks(page), before, "it stands still");
  // A tick in which no node changes is told with the next that does; within ten the walk ends.
  await eventually(async () => {
    await page.keyboard.press("n");
    return (await ticks(page)) > before;
  }, true, "it steps");

  await page.keyboard.press("2");
  const row = page.locator("tr[data-key=object]");
  await row.getByRole("button").click();
  await row.getByRole("textbox").fill("teapot");
  await row.getByRole("textbox").press("Enter");
  await eventually(() => row.locator(".value").innerText(), "teapot");

  await page.keyboard.press("1");
  await chooseNode(page, "rest");
  await page.getByRole("button", { name: "Break before" }).click();
  await eventually(() => page.getByRole("button", { name: "Break before" }).getAttribute("aria-pressed"), "true");
  await page.getByRole("button", { name: "Resume" }).click();
  await page.locator(".standing", { hasText: "Stopped before rest, at a breakpoint." }).waitFor();
  assert.notEqual((await shownStates(page)).rest, 1, "it has not begun");
  await page.getByRole("button", { name: "Break before" }).click();
  await eventually(() => page.getByRole("button", { name: "Break before" }).getAttribute("aria-pressed"), "false");
  await page.getByRole("button", { name: "Resume" }).click();
  await page.getByRole("button", { name: "Pause" }).waitFor();

  await chooseNode(page, "walk");
  await page.getByRole("button", { name: "Fail once" }).click();
  await page.locator(".run-facts [data-run-state=ended]").waitFor();
  await executor.ended;
  const end = JSON.parse(executor.said.at(-1));
  assert.equal(end.object, "teapot");
});

test("the emergency stop reaches the robot and ends a real execution", async () => {
  const { page, executor } = await monitored();
  await page.getByRole("button", { name: "Emergency stop" }).click();
  await world.said(executor, /stopped/);
  await executor.ended;
  assert.equal(JSON.parse(executor.said.at(-1)).ending, "CANCELLED");
});

test("halting ends a real execution as cancelled", async () => {
  const { page, executor } = await monitored();
  await page.getByRole("button", { name: "Halt the run" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Halt the run" }).click();
  await executor.ended;
  assert.equal(JSON.parse(executor.said.at(-1)).ending, "CANCELLED");
});
