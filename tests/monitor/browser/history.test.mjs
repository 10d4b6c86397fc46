import assert from "node:assert/strict";
import { test } from "node:test";
import { FakeServer } from "./fake_server.mjs";
import { errand, eventually, open, shownStates, trueStates } from "./harness.mjs";

async function outline(page) {
  await page.locator("[role=tree]").waitFor();
  await page.keyboard.press("o");
  await page.locator(".outline-row").first().waitFor();
}

test("scrubbing shows the past while the run goes on, and live brings the present back", async () => {
  const run = errand();
  const past = [];
  for (let i = 0; i < 12; i++) {
    run.tick();
    past.push(trueStates(run));
  }
  const { page } = await open([run]);
  await outline(page);
  await eventually(() => shownStates(page), past.at(-1));
  const slider = page.getByRole("slider", { name: "Moment of the run" });
  await slider.focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await eventually(() => shownStates(page), past[3], "0.2 s are four ticks");
  run.tick();
  await eventually(() => page.locator(".of").innerText(), "of 0.7 s", "the run is seen to go on");
  assert.deepEqual(await shownStates(page), past[3], "what is looked at stays");
  await page.keyboard.press("End");
  await eventually(() => shownStates(page), trueStates(run));
  run.tick();
  await eventually(() => page.getByTestId("tick").innerText(), "tick 14");
});

test("a click on the timeline looks at that moment", async () => {
  const run = errand();
  for (let i = 0; i < 200; i++) run.tick();
  const { page } = await open([run]);
  await outline(page);
  const box = await page.getByRole("slider").boundingBox();
  await page.mouse.click(box.x + 12 + (box.width - 28) / 2, box.y + 40);
  const shown = () => page.getByRole("slider").getAttribute("aria-valuenow").then(Number);
  assert.ok(Math.abs((await shown()) - 5) < 0.1, `${await shown()} s of 10 s`);
  await page.locator(".button.live:not(.on)").waitFor();
});

test("a finished run plays through its past", async () => {
  const run = errand("old", { kind: "live" });
  for (let i = 0; i < 60; i++) run.tick();
  run.kind = "recorded";
  run.end("success");
  const { page } = await open([run]);
  await outline(page);
  assert.equal(await page.getByRole("button", { name: "Pause" }).isDisabled(), true, "what is over cannot be paused");
  await page.getByLabel("Speed of playing").selectOption("10");
  await page.getByRole("button", { name: "Play from here" }).click();
  await page.getByRole("button", { name: "Stop playing" }).waitFor();
  await page.getByRole("button", { name: "Play from here" }).waitFor();
  await eventually(() => shownStates(page), trueStates(run));
});

test("the page reconnects after the server restarts, and catches up", async () => {
  const run = errand();
  run.tick();
  // While the server is away, the socket and whatever else the page asks for find nobody.
  const { page, server, record } = await open([run], { allowed: /WebSocket connection|net::ERR_(CONNECTION|EMPTY)/ });
  await outline(page);
  await eventually(() => shownStates(page), trueStates(run));
  await server.stop();
  await page.getByText("Connection lost; trying again…").waitFor();
  for (let i = 0; i < 6; i++) run.tick();
  record.server = await new FakeServer([run]).start(server.port);
  await page.getByText("Connection lost; trying again…").waitFor({ state: "detached" });
  await eventually(() => shownStates(page), trueStates(run));
});

test("an executor that starts later is opened by itself, and its restart is offered in the list", async () => {
  const { page, server } = await open([]);
  await page.getByText("Nothing runs yet").waitFor();
  const run = errand("first");
  run.tick();
  server.runs.push(run);
  await page.getByRole("heading", { name: "errand" }).first().waitFor();
  run.end("failure");
  const again = errand("second");
  server.runs.push(again);
  await page.locator(".run-button").click();
  await eventually(() => page.locator(".run-line").count(), 2);
  await page.locator(".run-line", { hasText: "running" }).click();
  again.tick();
  await eventually(() => page.getByTestId("tick").innerText(), "tick 1");
});

test("two runs stand side by side and the page leads to where they parted", async () => {
  const [a, b] = [errand("a"), errand("b")];
  for (let i = 0; i < 12; i++) a.tick();
  b.tree.forced.set(2, 3);
  for (let i = 0; i < 12; i++) b.tick();
  const { page, server } = await open([a, b]);
  server.comparison = { parted: { time_a: 0.05, time_b: 0.05, path: "errand/battery_ok", path_b: "errand/battery_ok", state_a: 2, state_b: 3, words: "from the beginning: in A battery_ok succeeded; in B it failed" }, words: "" };
  await page.locator(".run-button").click();
  await page.getByRole("button", { name: /Compare with/ }).first().click();
  await page.locator(".parting", { hasText: "in A battery_ok succeeded; in B it failed" }).waitFor();
  await page.getByRole("button", { name: "Show this moment" }).click();
  await eventually(() => page.getByRole("slider").evaluateAll((sliders) => sliders.map((slider) => slider.getAttribute("aria-valuenow"))), ["0.05", "0.05"]);
  const chosen = () => page.locator("[role=treeitem][aria-selected=true]").evaluateAll((items) => items.map((item) => item.getAttribute("aria-label")));
  await eventually(chosen, ["battery_ok, BatteryOk, SUCCESS", "battery_ok, BatteryOk, IDLE, last FAILURE"]);
});
