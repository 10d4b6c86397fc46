// The arrow keys on a tree, as every tree on a desktop has them.

import type { Run } from "./run";

/** True when the key meant something here. */
export function walk(run: Run, key: string): boolean {
  const tree = run.tree.value;
  if (tree === null) return false;
  const rows = tree.rows(run.collapsed.value);
  const at = run.selected.value;
  const row = rows.indexOf(at);
  const node = tree.nodes[at];
  const go = (index: number | undefined): boolean => {
    if (index !== undefined && index >= 0) run.selected.value = index;
    return true;
  };
  switch (key) {
    case "ArrowDown": return go(rows[row + 1]);
    case "ArrowUp": return go(row < 0 ? rows[0] : rows[row - 1]);
    case "Home": return go(rows[0]);
    case "End": return go(rows.at(-1));
    case "PageDown": return go(rows[Math.min(rows.length - 1, row + 15)]);
    case "PageUp": return go(rows[Math.max(0, row - 15)]);
    case "ArrowRight":
      if (node === undefined) return go(rows[0]);
      if (run.collapsed.value.has(at)) run.fold(at, false);
      else go(node.children[0]);
      return true;
    case "ArrowLeft":
      if (node === undefined) return go(rows[0]);
      if (node.children.length > 0 && !run.collapsed.value.has(at)) run.fold(at, true);
      else go(node.parentIndex);
      return true;
    case "Enter":
      if (node !== undefined) run.fold(at, !run.collapsed.value.has(at));
      return true;
    default: return false;
  }
}
