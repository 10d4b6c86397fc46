import assert from "node:assert/strict";
import { test } from "node:test";
import { leaf, sequence, FAILURE } from "./behavior_tree.mjs";
import { FakeRun } from "./fake_run.mjs";
import { chooseNode, errand, eventually, open, shownStates, trueStates } from "./harness.mjs";
import { big } from "./scripted_trees.mjs";

test("every node shows its state after each tick of a scripted tree", async () => {
  const run = errand();
  const { page } = await open([run]);
  await page.keyboard.press("o");
  await page.locator(".outline-row").first().waitFor();
  const seen = new Set();
  for (let tick = 0; tick < 12; tick++) {
    run.tick();
    await eventually(() => shownStates(page), trueStates(run), `after tick ${run.ticks}`);
    Object.values(trueStates(run)).forEach((state) => seen.add(state));
  }
  assert.deepEqual([...seen].sort(), [0, 1, 2, 3], "the script meets idle, running, success and failure");
});

test("the drawing paints a node in the colour of its state", async () => {
  const run = errand();
  const { page } = await open([run]);
  run.tick();
  await chooseNode(page, "battery_ok");
  // The middle of the upper edge of the card, where nothing but its border is.
  const border = () => page.evaluate(() => {
    const box = document.querySelector("[role=treeitem][aria-selected=true]").getBoundingClientRect();
    const canvas = document.querySelector(".graph-host canvas");
    const at = canvas.getBoundingClientRect();
    const strip = canvas.getContext("2d").getImageData(Math.round(box.left + box.width / 2 - at.left), Math.round(box.top - at.top) - 1, 1, 4).data;
    const wanted = getComputedStyle(document.documentElement).getPropertyValue("--success").trim();
    const rgb = [1, 3, 5].map((i) => parseInt(wanted.slice(i, i + 2), 16));
    return [0, 4, 8, 12].some((i) => rgb.every((value, c) => Math.abs(strip[i + c] - value) < 40));
  });
  await eventually(border, true, "the border has the colour of success");
});

test("a failed node tells why, with counts, ports and what they read", async () => {
  const run = errand();
  run.set("hook", "Pose2D", "x 1.00 y 2.00");
  const { page } = await open([run]);
  for (let i = 0; i < 5; i++) run.tick();
  await chooseNode(page, "holds_key");
  await eventually(() => page.locator(".why").innerText(), "Why it failed\n\nthe hand is empty");
  await eventually(() => page.locator(".counts").first().innerText(), "Starts\n1\nSuccesses\n0\nFailures\n1\nTime running\n0.0 s");
  await chooseNode(page, "go_to_hook");
  await eventually(() => page.locator(".facts tbody tr").innerText(), "goal\t{hook}\tx 1.00 y 2.00");
});

test("an idle node that its parent reset shows what it returned", async () => {
  const run = errand();
  const { page } = await open([run]);
  const take = run.tree.records.find((record) => record.name === "take_key").uid;
  while (run.tree.results[take] !== FAILURE || run.tree.states[take] !== 0) run.tick();
  await chooseNode(page, "take_key");
  await page.getByText("It returned FAILURE and was reset by its parent.").waitFor();
});

test("blackboard entries that change are highlighted, the others are not", async () => {
  const run = errand();
  const { page } = await open([run]);
  for (let i = 0; i < 60; i++) run.tick();
  await page.keyboard.press("2");
  await page.locator("tr[data-key=object]").waitFor();
  run.set("object", "string", "teapot");
  run.tick();
  await eventually(() => page.locator("tr.fresh").evaluateAll((rows) => rows.map((row) => row.dataset.key)), ["object"]);
  assert.match(await page.locator("tr[data-key=object]").innerText(), /teapot/);
});

test("log lines lead to their node", async () => {
  const run = errand();
  const { page } = await open([run]);
  for (let i = 0; i < 7; i++) run.tick();
  await page.keyboard.press("4");
  await page.locator(".log-line.warning .log-node").first().click();
  await page.keyboard.press("1");
  await eventually(() => page.locator(".node-name").innerText(), "take_key");
});

test("names and values with markup are shown as text and run nothing", async () => {
  const nasty = `<script>window.hacked = 1</script><img src=x onerror="window.hacked = 2">`;
  const root = sequence(nasty, [leaf("Act", { name: `${nasty} leaf`, ports: { [nasty]: nasty }, ticks: 100, why: nasty }), leaf("Act", { name: "last" })]);
  const run = new FakeRun("nasty", root, { task: nasty, tree: nasty, robot: nasty, scene: nasty });
  run.set(nasty, nasty, nasty);
  run.log.push({ time: 0, level: "error", node: nasty, code: nasty, message: nasty, logger: nasty });
  run.marks.push({ time: 0, kind: nasty, text: nasty });
  run.tick();
  run.tree.messages[2] = nasty;
  const { page } = await open([run], { width: 2560 });
  await page.locator(".log-line.error").waitFor();
  await page.locator(".run-button").click();
  await page.locator(".run-line").waitFor();
  await page.keyboard.press("Escape");
  await page.keyboard.press("o");
  await page.locator(".outline-row").nth(1).click();
  await eventually(() => page.locator(".node-name").innerText(), `${nasty} leaf`);
  assert.equal(await page.evaluate(() => window.hacked), undefined);
  assert.equal(await page.locator("img[src=x], body script").count(), 0);
  assert.equal(await page.locator(".run-title").innerText(), nasty);
});

test("two thousand nodes open folded, and unfold", async () => {
  const run = new FakeRun("big", big(2000), { task: "patrol", endless: true }, { history: 50 });
  run.tick();
  const { page } = await open([run]);
  await page.keyboard.press("o");
  await page.locator(".outline-row").first().waitFor();
  const rows = () => page.locator(".outline-rows").evaluate((element) => Math.round(element.getBoundingClientRect().height / 30));
  assert.ok((await rows()) <= 200, `opens with ${await rows()} rows`);
  await page.keyboard.press("e");
  await eventually(rows, run.tree.records.length);
  assert.ok((await page.locator(".outline-row").count()) < 80, "only the rows in view exist");
});

test("tools, map and legend lie beside the drawing of a tall tree, so that they cover no node, and beside each other", async () => {
  const run = new FakeRun("tall", big(300), { task: "tall", tree: "tall" });
  run.tick();
  const { page } = await open([run], { width: 1400, height: 900 });
  await page.locator(".minimap:visible").waitFor();
  for (const width of [1400, 1100, 900, 400]) {
    await page.setViewportSize({ width, height: 900 });
    await eventually(() => overlaps(page, [".graph-host", ".graph-tools", ".minimap", ".legend"]), [], `${width} px`);
  }
});

test("a drawing that was in view is in view in a smaller window, too", async () => {
  const { page } = await open([errand()], { width: 1400, height: 900 });
  const root = page.locator(".graph-item[data-index='0']");
  const inView = async () => {
    const [box, host] = [await root.boundingBox(), await page.locator(".graph-host").boundingBox()];
    return box !== null && host !== null && box.x >= host.x && box.y >= host.y
      && box.x + box.width <= host.x + host.width && box.y + box.height <= host.y + host.height;
  };
  await page.keyboard.press("d");
  await eventually(inView, true, "1400 px");
  for (const width of [900, 400, 1400, 400]) {
    await page.setViewportSize({ width, height: 700 });
    await eventually(inView, true, `${width} px`);
  }
});

/** The pairs of shown boxes that cover each other, and boxes that leave the window. */
async function overlaps(page, selectors) {
  const window = page.viewportSize();
  const boxes = [];
  for (const selector of selectors) {
    const box = await page.locator(`${selector}:visible`).boundingBox({ timeout: 200 }).catch(() => null);
    if (box !== null) boxes.push({ selector, left: box.x, top: box.y, right: box.x + box.width, bottom: box.y + box.height });
  }
  const out = boxes.filter((box) => box.left < 0 || box.top < 0 || box.right > window.width || box.bottom > window.height);
  const covering = boxes.flatMap((a, at) =>
    boxes
      .slice(at + 1)
      .filter((b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)
      .map((b) => `${a.selector} and ${b.selector}`),
  );
  return [...covering, ...out.map((box) => `${box.selector} leaves the window`)];
}

test("of two runs the one that is opened late shows what came before", async () => {
  const [first, second] = [errand("first"), errand("second")];
  const { page } = await open([first, second]);
  for (let tick = 0; tick < 8; tick++) for (const run of [first, second]) run.tick();
  await page.locator(".run-button").click();
  await page.locator(".run-line").nth(1).click();
  await page.keyboard.press("o");
  await eventually(() => shownStates(page), trueStates(second));
  await page.keyboard.press("4");
  await page.locator(".log-line.warning", { hasText: "KEY_SLIPPED" }).first().waitFor();
  const slider = page.getByRole("slider", { name: "Moment of the run" });
  await slider.focus();
  await page.keyboard.press("Home");
  await eventually(() => shownStates(page).then((states) => states.open_door), 0);
});
