// The page before a run with `--watch`: a changed tree file is drawn while its running node continues; a file that cannot take over waits.

import assert from "node:assert/strict";
import { writeFile } from "node:fs/promises";
import { join } from "node:path";
import { afterEach, beforeEach, test } from "node:test";
import { programs, START } from "./programs.mjs";
import { eventually, look } from "./harness.mjs";

const xml = (walk, second) => `<root BTCPP_format="4"><BehaviorTree ID="Errand"><Sequence name="errand">
  <Sleep name="${walk}" msec="300000"/><Sleep name="${second}" msec="100"/></Sequence></BehaviorTree></root>`;
const world = programs();

beforeEach(() => world.begin());
afterEach(() => world.end());

test("a changed tree is drawn while its running node continues; one without that node waits", async () => {
  const tree = join(world.folder, "errand.xml");
  await writeFile(tree, xml("walk", "rest"));
  const monitor = world.start("-m", "bestman_bt.cli.main", "monitor", "--port", "0", "--no-browser");
  const url = /http\S+/.exec(await world.said(monitor, /http:/))[0];
  const run = world.start(
    "-m", "bestman_bt.cli.main", "run", tree, "--robot", "turtle", "--watch", "--real-time", "--runs", join(world.folder, "runs"),
  );
  const page = await look(url);
  await page.getByRole("heading", { name: "errand", level: 1 }).waitFor({ timeout: START });
  await page.keyboard.press("o");
  const shown = () => page.$$eval(".outline-row", (rows) =>
    rows.map((row) => `${row.querySelector(".row-name").textContent} ${row.dataset.state}`));
  await eventually(shown, ["Errand 1", "errand 1", "walk 1", "rest 0"]);

  await writeFile(tree, xml("walk", "sing"));
  const replaced = ["errand 0", "walk 0", "rest 0"];
  await eventually(shown, ["Errand 1", ...replaced, "errand 1", "walk 1", "sing 0"]);

  await writeFile(tree, xml("run", "sing"));
  await eventually(() => run.complaints().match(/warning: the changed tree waits.*/)?.[0].replace(tree, "errand.xml"),
    "warning: the changed tree waits: walk (errand.xml:2) is running, and the new tree has no node 'walk'");
  assert.deepEqual(await shown(), ["Errand 1", ...replaced, "errand 1", "walk 1", "sing 0"], "the old tree continues");
});
