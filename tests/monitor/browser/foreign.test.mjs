// The page before a process of BehaviorTree.CPP (its own publisher, in C++): drawn, held at a breakpoint, followed through a restart.

import assert from "node:assert/strict";
import { writeFile } from "node:fs/promises";
import { join } from "node:path";
import { afterEach, beforeEach, test } from "node:test";
import { fileURLToPath } from "node:url";
import { freePort, programs } from "./programs.mjs";
import { chooseNode, eventually, look, shownStates } from "./harness.mjs";

const PUBLISHER = fileURLToPath(new URL("../groot2/behaviortreepy_publisher.py", import.meta.url));
const XML = `<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence name="main">
  <Script name="init" code="s := 'text'"/><SubTree ID="Sub" name="sub"/></Sequence></BehaviorTree>
  <BehaviorTree ID="Sub"><Sequence name="do"><AlwaysSuccess name="yes"/><Work name="work"/></Sequence></BehaviorTree></root>`;
const world = programs();
let port, tree;

function ticking() {
  const cpp = world.start(PUBLISHER, tree, String(port));
  const timer = setInterval(() => cpp.child.exitCode === null ? cpp.child.stdin.write("tick\n") : clearInterval(timer), 100);
  cpp.child.on("exit", () => clearInterval(timer));
  cpp.child.stdin.on("error", () => clearInterval(timer));
  return cpp;
}

beforeEach(async () => {
  await world.begin();
  [port, tree] = [await freePort(), join(world.folder, "tree.xml")];
  await writeFile(tree, XML);
});
afterEach(() => world.end());

test("a process of BehaviorTree.CPP is drawn, held, let go, and followed when it starts again", async () => {
  const monitor = world.start(
    "-m", "bestman_bt.cli.main", "monitor", "--port", "0", "--no-browser",
    "--connect", `groot2://127.0.0.1:${port}`, "--runs", join(world.folder, "runs"),
  );
  const page = await look(/http\S+/.exec(await world.said(monitor, /http:/))[0]);
  const first = ticking();
  await page.getByRole("heading", { name: "Main", level: 1 }).waitFor({ timeout: 90_000 });
  await page.getByText(`groot2://127.0.0.1:${port}`).first().waitFor();
  await page.keyboard.press("o");
  await eventually(async () => Object.keys(await shownStates(page)).sort(), ["do", "init", "main", "sub", "work", "yes"]);
  assert.equal(await page.getByRole("button", { name: "Emergency stop" }).isDisabled(), true, "it is only watched");

  await page.keyboard.press("2");
  await eventually(() => page.locator("tr[data-key=s] .value").innerText(), "text");

  await page.keyboard.press("1");
  await chooseNode(page, "work");
  await page.getByRole("button", { name: "Break before" }).click();
  await page.locator(".standing", { hasText: "Stopped before work, at a breakpoint." }).waitFor();
  await page.getByRole("button", { name: "Break before" }).click();
  await page.locator(".standing").waitFor({ state: "hidden" });

  first.child.kill("SIGKILL");
  await first.ended;
  await page.locator(".run-facts [data-run-state=ended]").waitFor();
  ticking();
  await page.locator(".run-facts [data-run-state=running]").waitFor();
  await eventually(async () => (await page.getByTestId("clock").innerText()) !== "0.00 s", true);
  assert.equal(await page.locator(".run-facts [data-run-state]").getAttribute("data-run-state"), "running");
});
