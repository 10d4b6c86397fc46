// Python programs that a story starts, in a runtime folder of their own, and ends with the story.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

const PYTHON = process.env.PYTHON ?? "python3";
export const START = 90_000; // ms; Python starts slowly on a busy machine

/** `begin` before and `end` after each test; `folder` lasts as long. */
export function programs() {
  let children = [];
  const world = {
    folder: "",
    async begin() {
      world.folder = await mkdtemp(join(tmpdir(), "monitor-"));
    },
    async end() {
      children.forEach(({ child }) => child.kill("SIGKILL"));
      await Promise.all(children.map(({ ended }) => ended)); // until then they write into the folder
      children = [];
      await rm(world.folder, { recursive: true });
    },
    /** Starts a Python program; `said` collects its lines. */
    start(...words) {
      const child = spawn(PYTHON, words, { env: { ...process.env, XDG_RUNTIME_DIR: world.folder }, stdio: ["pipe", "pipe", "pipe"] });
      const said = [];
      let complaints = "";
      child.stderr.on("data", (text) => (complaints += text));
      createInterface({ input: child.stdout }).on("line", (line) => said.push(line));
      const ended = new Promise((resolve) => child.on("exit", resolve));
      children.push({ child, ended });
      return { child, said, ended, complaints: () => complaints };
    },
    async said(program, pattern) {
      for (const deadline = Date.now() + START; Date.now() < deadline; ) {
        const line = program.said.find((candidate) => pattern.test(candidate));
        if (line !== undefined) return line;
        assert.equal(program.child.exitCode, null, program.complaints());
        await new Promise((resolve) => setTimeout(resolve, 50));
      }
      assert.fail(`it never said ${pattern}: ${program.complaints()}`);
    },
  };
  return world;
}

/** One that nobody has, below those that the system gives to outgoing connections: one of those may be taken soon. */
export function freePort() {
  return new Promise((resolve) => {
    const server = createServer();
    server.on("error", () => resolve(freePort()));
    const port = 20_000 + Math.floor(Math.random() * 12_000);
    server.listen(port, "127.0.0.1", () => server.close(() => resolve(port)));
  });
}
