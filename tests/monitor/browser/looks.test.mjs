import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { demonstration, PACKAGES } from "./fake_server.mjs";
import { chooseNode, errand, open } from "./harness.mjs";

const AXE = await readFile(PACKAGES.resolve("axe-core/axe.min.js"), "utf8");

function fetching() {
  const run = demonstration(0);
  for (let i = 0; i < 250; i++) run.tick();
  return run;
}

async function serious(page) {
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => window.axe.run());
  return violations
    .filter((violation) => ["serious", "critical"].includes(violation.impact))
    .map((violation) => `${violation.id}: ${violation.nodes.map((node) => node.html.slice(0, 120)).join(" | ")}`);
}

for (const theme of ["light", "dark"]) {
  test(`axe finds nothing serious in the ${theme} theme, all panels at once`, async () => {
    const { page } = await open([fetching()], { theme, width: 2560, height: 1300 });
    await chooseNode(page, "SecondLook");
    await page.locator(".joint").first().waitFor();
    await page.keyboard.press("Escape");
    await page.keyboard.press("m");
    assert.deepEqual(await serious(page), []);
  });
}

test("axe finds nothing serious on a phone, nor in the list of keys", async () => {
  const { page } = await open([fetching()], { width: 360, height: 740 });
  await page.locator(".outline-row").first().waitFor();
  assert.deepEqual(await serious(page), []);
  await page.getByRole("button", { name: "Keys (?)" }).click();
  await page.getByRole("dialog", { name: "Keys" }).waitFor();
  assert.deepEqual(await serious(page), []);
});

for (const width of [360, 768, 1280, 2560]) {
  test(`at ${width} px everything is within the page, and the emergency stop in sight`, async () => {
    const { page } = await open([fetching()], { width, height: width < 500 ? 740 : 900 });
    await page.getByTestId("clock").waitFor();
    const panels = width < 720 ? ["Tree", "Node", "Blackboard", "Robot", "Log"] : [null];
    for (const panel of panels) {
      if (panel !== null) await page.locator(".phone-tabs").getByRole("button", { name: panel }).click();
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(overflow <= 0, `${panel}: ${overflow} px too wide`);
      const outside = await page.$$eval("header button, header h1, .timeline-bar button, .phone-tabs button", (parts) => parts
        .filter((part) => part.getClientRects().length > 0)
        .filter((part) => { const box = part.getBoundingClientRect(); return box.left < -0.5 || box.right > innerWidth + 0.5 || box.top < -0.5 || box.bottom > innerHeight + 0.5; })
        .map((part) => part.outerHTML.slice(0, 80)));
      assert.deepEqual(outside, [], `${panel}`);
      const stop = await page.getByRole("button", { name: "Emergency stop" }).boundingBox();
      assert.ok(stop.width >= 36 && stop.height >= 36, JSON.stringify(stop));
    }
  });
}

test("the theme is chosen and kept", async () => {
  const { page } = await open([errand()], { theme: "light" });
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  assert.equal(await theme(), "light");
  await page.keyboard.press("t");
  assert.equal(await theme(), "dark");
  await page.reload();
  await page.getByTestId("clock").waitFor();
  assert.equal(await theme(), "dark");
});

test("each state has a shape of its own, and so has a condition that does not hold", async () => {
  const run = errand();
  const { uid } = run.tree.records.find((node) => node.category === "condition");
  for (const moment of run.history) [moment.states[uid], moment.results[uid]] = [0, 5];
  const { page } = await open([run]);
  const shapes = await page.locator(".legend .shape").evaluateAll((found) => found.map((shape) => shape.innerHTML));
  assert.equal(new Set(shapes).size, 6);
  await page.keyboard.press("o");
  await page.locator(".outline-row .shape.no.faint").first().waitFor();
});

test("the robot's map, joints and pictures are drawn", async () => {
  const { page } = await open([fetching()]);
  await page.keyboard.press("3");
  await page.locator(".joint").first().waitFor();
  const painted = (selector) => page.locator(selector).evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const colours = new Set();
    for (let i = 0; i < data.length; i += 40) if (data[i + 3] > 200) colours.add(`${data[i]},${data[i + 1]},${data[i + 2]}`);
    return colours.size;
  });
  await page.waitForTimeout(200);
  assert.ok((await painted(".map canvas")) >= 4, "floor, walls, lidar and base have colours of their own");
  assert.ok((await painted(".plot canvas")) >= 4, "curves have colours of their own");
  await page.getByAltText(/What head_camera saw/).waitFor();
});
