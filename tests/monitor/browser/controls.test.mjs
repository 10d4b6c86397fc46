import assert from "node:assert/strict";
import { test } from "node:test";
import { FAILURE, RUNNING } from "./behavior_tree.mjs";
import { chooseNode, errand, eventually, open } from "./harness.mjs";

const asked = (run) => run.received.map(({ id: _, n: __, ...control }) => control);

test("pause, step and resume act on the executor", async () => {
  const run = errand();
  run.tick();
  const { page } = await open([run]);
  await page.getByRole("button", { name: "Pause" }).click();
  await page.getByText("Paused. The robot stands still until you resume.").waitFor();
  run.tick();
  assert.equal(run.ticks, 1, "a paused executor does not tick by itself");
  await page.getByRole("button", { name: "Step one tick" }).click();
  await eventually(() => page.getByTestId("tick").innerText(), "tick 2");
  await page.getByRole("button", { name: "Resume" }).click();
  await page.getByRole("button", { name: "Pause" }).waitFor();
  assert.deepEqual(asked(run), [{ do: "pause" }, { do: "step" }, { do: "resume" }]);
});

test("the same by keyboard", async () => {
  const run = errand();
  run.tick();
  const { page } = await open([run]);
  await page.getByTestId("tick").waitFor();
  await page.keyboard.press("Space");
  await eventually(() => asked(run), [{ do: "pause" }]);
  await page.getByRole("button", { name: "Resume" }).waitFor();
  await page.keyboard.press("n");
  await eventually(() => run.ticks, 2);
});

test("a breakpoint with a condition stops the executor at its node, and is cleared again", async () => {
  const run = errand();
  const { page } = await open([run]);
  await chooseNode(page, "open_door");
  await page.getByLabel("Condition of the breakpoint").fill("attempts > 1");
  await page.getByRole("button", { name: "Break before" }).click();
  await page.getByText("Breaks before it if attempts > 1").waitFor();
  const uid = run.tree.records.find((record) => record.name === "open_door").uid;
  assert.deepEqual(asked(run), [{ do: "breakpoint", node: uid, when: "before", condition: "attempts > 1", once: false }]);
  for (let i = 0; i < 20; i++) run.tick();
  assert.equal(run.tree.states[uid], RUNNING);
  await page.locator(".standing", { hasText: "Stopped before open_door, at a breakpoint." }).waitFor();
  await page.getByRole("button", { name: "Break before" }).click();
  await eventually(() => asked(run).at(-1), { do: "clear_breakpoint", node: uid, when: "before" });
  await eventually(() => page.getByRole("button", { name: "Break before" }).getAttribute("aria-pressed"), "false");
});

test("a node's result is forced once", async () => {
  const run = errand();
  const { page } = await open([run]);
  await chooseNode(page, "battery_ok");
  await page.getByRole("button", { name: "Fail once" }).click();
  await page.getByText("battery_ok: its next result will be FAILURE").waitFor();
  run.tick();
  assert.equal(run.tree.results[2], FAILURE);
});

test("a blackboard entry is set, and a refusal is told in the executor's words", async () => {
  const run = errand();
  const { page } = await open([run]);
  await page.keyboard.press("2");
  const row = page.locator("tr[data-key=object]");
  await row.getByRole("button").click();
  await row.getByRole("textbox").fill("teapot");
  await row.getByRole("textbox").press("Enter");
  await eventually(() => row.locator(".value").innerText(), "teapot");
  await row.getByRole("button").click();
  await row.getByRole("textbox").fill("refused");
  await row.getByRole("textbox").press("Enter");
  await page.locator(".notice.bad", { hasText: "'refused' is no string" }).waitFor();
});

test("the speed of the robot is chosen, also while the run is paused", async () => {
  const run = errand("errand", { withRobot: true });
  run.tick();
  const { page } = await open([run]);
  await page.getByRole("button", { name: "Pause" }).click();
  await page.getByRole("button", { name: "Resume" }).waitFor();
  await page.getByLabel("Speed of the robot").selectOption({ label: "30% speed" });
  await eventually(() => asked(run), [{ do: "pause" }, { do: "speed", share: 0.3 }]);
  await eventually(() => page.getByLabel("Speed of the robot").inputValue(), "0.3");
});

test("halting asks first; only the answer halts", async () => {
  const run = errand();
  run.tick();
  const { page } = await open([run]);
  await page.getByRole("button", { name: "Halt the run" }).click();
  await page.getByRole("button", { name: "Leave it running" }).click();
  assert.deepEqual(asked(run), []);
  await page.getByRole("button", { name: "Halt the run" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Halt the run" }).click();
  await eventually(() => asked(run), [{ do: "halt" }]);
  await page.locator(".run-facts [data-run-state=ended]").waitFor();
});

test("the emergency stop acts at once, by button and by key", async () => {
  for (const press of [(page) => page.getByRole("button", { name: "Emergency stop" }).click(), (page) => page.keyboard.press("Shift+X")]) {
    const run = errand();
    run.tick();
    const { page } = await open([run]);
    await page.getByTestId("tick").waitFor();
    await press(page);
    await eventually(() => asked(run), [{ do: "stop" }]);
  }
});

test("a read-only monitor shows and controls nothing", async () => {
  const run = errand();
  run.tick();
  const { page } = await open([run], { readOnly: true });
  for (const name of ["Pause", "Step one tick", "Halt the run", "Emergency stop"]) {
    assert.equal(await page.getByRole("button", { name }).isDisabled(), true, name);
  }
  await page.keyboard.press("Space");
  await page.keyboard.press("Shift+X");
  await chooseNode(page, "open_door");
  assert.equal(await page.getByRole("button", { name: "Break before" }).isDisabled(), true);
  assert.deepEqual(asked(run), []);
});

test("a motion that waits to be confirmed is told and drawn, and started or declined", async () => {
  const run = errand("errand", { withRobot: true });
  run.tick();
  const swept = [[[0, 0], [1.2, 0], [1.2, 0.8], [0, 0.8]]];
  const waits = () => run.pause({ time: run.time, reason: "confirm", node: null, when: null, words: "arm: along a trajectory; 2.1 s", swept });
  waits();
  const { page } = await open([run]);
  await page.getByText("A motion waits for you. arm: along a trajectory; 2.1 s").waitFor();
  await page.keyboard.press("3");
  await page.getByRole("button", { name: "Start it" }).click();
  await eventually(() => asked(run), [{ do: "resume" }]);
  await page.getByText("A motion waits for you.").waitFor({ state: "hidden" });
  waits();
  await page.getByRole("button", { name: "Decline it" }).click();
  await eventually(() => asked(run).at(-1), { do: "decline" });
});
