// Dark and light: the choice is kept; canvases read the same custom properties as the style sheets.

import { computed, effect, signal } from "@preact/signals";

export type Theme = "auto" | "light" | "dark";

const KEY = "bestman-bt-theme";
const dark = matchMedia("(prefers-color-scheme: dark)");
const systemDark = signal(dark.matches);
dark.addEventListener("change", (event) => (systemDark.value = event.matches));

function kept(): Theme {
  const value = localStorage.getItem(KEY);
  return value === "light" || value === "dark" ? value : "auto";
}

export const theme = signal<Theme>(kept());
export const isDark = computed(() => (theme.value === "auto" ? systemDark.value : theme.value === "dark"));

export function turnTheme(): void {
  theme.value = isDark.value ? "light" : "dark";
  localStorage.setItem(KEY, theme.value);
}

export interface Palette {
  ink: string;
  muted: string;
  faint: string;
  line: string;
  surface: string;
  raised: string;
  canvas: string;
  accent: string;
  free: string;
  wall: string;
  scan: string;
  states: string[];
  soft: string[];
  sign: string;
}

function read(): Palette {
  const style = getComputedStyle(document.documentElement);
  const get = (name: string): string => style.getPropertyValue(name).trim();
  const names = ["idle", "running", "success", "failure", "skipped", "no"];
  return {
    ink: get("--ink"),
    muted: get("--muted"),
    faint: get("--faint"),
    line: get("--line"),
    surface: get("--surface"),
    raised: get("--raised"),
    canvas: get("--canvas"),
    accent: get("--accent"),
    free: get("--free"),
    wall: get("--wall"),
    scan: get("--scan"),
    states: names.map((name) => get(`--${name}`)),
    soft: names.map((name) => get(`--${name}-soft`)),
    sign: get("--sign"),
  };
}

export const palette = signal<Palette>({} as Palette);

export function startTheme(): void {
  effect(() => {
    document.documentElement.dataset["theme"] = isDark.value ? "dark" : "light";
    palette.value = read();
  });
}

export const FONT = '"Inter Variable", system-ui, sans-serif';
export const calm = matchMedia("(prefers-reduced-motion: reduce)");
