import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { defineConfig, type Plugin } from "vite";

const BUNDLED = ["preact", "@preact/signals", "@preact/signals-core", "d3-hierarchy", "uplot", "@fontsource-variable/inter"];

/** The licences of what the bundle contains travel with it. */
function licences(): Plugin {
  return {
    name: "licences",
    generateBundle() {
      const texts = BUNDLED.map((name) => {
        const folder = new URL(`node_modules/${name}/`, import.meta.url);
        const file = readdirSync(folder).find((candidate) => /^licen[cs]e/i.test(candidate));
        if (file === undefined) throw new Error(`${name} has no licence file`);
        return `${name}\n\n${readFileSync(new URL(file, folder), "utf8").trim()}\n`;
      });
      this.emitFile({ type: "asset", fileName: "LICENSES.txt", source: texts.join(`\n${"-".repeat(80)}\n\n`) });
    },
  };
}

/** The colours of the states as custom properties: one file has them for this page and for all that Python shows. */
const PALETTE = "../../engine/palette.json";

function palette(): Plugin {
  const name = "virtual:palette.css";
  return {
    name: "palette",
    resolveId: (id) => (id === name ? `\0${name}` : undefined),
    load(id) {
      if (id !== `\0${name}`) return undefined;
      const file = join(import.meta.dirname, PALETTE);
      this.addWatchFile(file);
      const states = Object.entries(JSON.parse(readFileSync(file, "utf8")) as Record<string, Record<string, string>>);
      const ground = (which: string): string =>
        states.map(([state, told]) => `--${state}: ${told[which]}; --${state}-soft: ${told[`${which}-soft`]};`).join(" ");
      return `:root { ${ground("light")} } :root[data-theme="dark"] { ${ground("dark")} }`;
    },
  };
}

/** A digest of the sources beside the built files; a test holds the committed build to the committed sources. */
function digest(): Plugin {
  return {
    name: "digest",
    generateBundle() {
      const root = import.meta.dirname;
      const names = [PALETTE, "index.html", "package-lock.json", ...["src", "public"].flatMap((folder) =>
        readdirSync(join(root, folder), { recursive: true, withFileTypes: true })
          .filter((entry) => entry.isFile())
          .map((entry) => join(entry.parentPath, entry.name).slice(root.length + 1)))].sort();
      const hash = createHash("sha256");
      for (const name of names) hash.update(`${name}\n`).update(readFileSync(join(root, name)));
      this.emitFile({ type: "asset", fileName: "SOURCES.sha256", source: `${hash.digest("hex")}\n` });
    },
  };
}

// Files are never inlined as data: URLs, because the server's Content-Security-Policy allows scripts of its own origin only.
export default defineConfig({
  base: "./",
  plugins: [palette(), licences(), digest()],
  build: {
    outDir: "../static",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    target: "es2022",
    chunkSizeWarningLimit: 300,
  },
  server: { port: 8751, proxy: { "/ws": { target: "ws://127.0.0.1:8750", ws: true }, "/runs": "http://127.0.0.1:8750" } },
});
