// The nodes of a run as one array in drawing order, with what the views ask of them: rows, search, ancestors.

import type { NodeRecord } from "./protocol";

export interface TreeNode extends NodeRecord {
  /** Position in `Tree.nodes`; the key by which the whole page speaks of a node. */
  index: number;
  parentIndex: number;
  children: number[];
  depth: number;
  /** Nodes below this one. */
  size: number;
}

export class Tree {
  readonly nodes: TreeNode[] = [];
  private readonly byUid = new Map<number, number>();

  constructor(records: NodeRecord[]) {
    records.forEach((record) => this.add(record));
    // Children come after their parents.
    for (let i = this.nodes.length - 1; i >= 0; i--) {
      const node = this.nodes[i]!;
      if (node.parentIndex >= 0) this.nodes[node.parentIndex]!.size += node.size + 1;
    }
  }

  private add(record: NodeRecord): void {
    const parentIndex = record.parent === null ? -1 : this.indexOf(record.parent);
    const parent = this.nodes[parentIndex];
    const index = this.nodes.length;
    const depth = parent === undefined ? 0 : parent.depth + 1;
    this.nodes.push({ ...record, index, parentIndex, children: [], depth, size: 0 });
    parent?.children.push(index);
    this.byUid.set(record.uid, index);
  }

  /** -1 where there is no such node. */
  indexOf(uid: number): number {
    return this.byUid.get(uid) ?? -1;
  }

  /** By number or by path, as log lines and breakpoints name nodes; -1 where nothing fits. */
  find(node: number | string | null | undefined): number {
    if (node === null || node === undefined || node === "") return -1;
    if (typeof node === "number") return this.indexOf(node);
    const byPath = this.nodes.findIndex((candidate) => candidate.path === node);
    return byPath >= 0 ? byPath : this.nodes.findIndex((candidate) => candidate.name === node);
  }

  ancestors(index: number): number[] {
    const found: number[] = [];
    for (let at = this.nodes[index]?.parentIndex ?? -1; at >= 0; at = this.nodes[at]!.parentIndex) found.push(at);
    return found;
  }

  /** Indices in drawing order without what lies under collapsed nodes. */
  rows(collapsed: ReadonlySet<number>): number[] {
    const found: number[] = [];
    const visit = (index: number): void => {
      found.push(index);
      if (!collapsed.has(index)) this.nodes[index]!.children.forEach(visit);
    };
    if (this.nodes.length > 0) visit(0);
    return found;
  }

  search(text: string): number[] {
    const words = text.toLowerCase().split(/\s+/).filter(Boolean);
    if (words.length === 0) return [];
    return this.nodes
      .filter((node) => {
        const all = `${node.name} ${node.type}`.toLowerCase();
        return words.every((word) => (word.includes("/") ? node.path.toLowerCase() : all).includes(word));
      })
      .map((node) => node.index);
  }

  /** What a big tree opens with: subtrees are folded, deepest first, until about `most` nodes show. */
  folded(most: number): Set<number> {
    const collapsed = new Set<number>();
    const candidates = this.nodes
      .filter((node) => node.children.length > 0 && node.depth > 0)
      .sort((a, b) => b.depth - a.depth || b.index - a.index);
    let shown = this.nodes.length;
    const hidden = new Map<number, number>();
    for (const node of candidates) {
      if (shown <= most) break;
      const below = node.size - (hidden.get(node.index) ?? 0);
      collapsed.add(node.index);
      shown -= below;
      for (const ancestor of this.ancestors(node.index)) hidden.set(ancestor, (hidden.get(ancestor) ?? 0) + below);
    }
    return collapsed;
  }
}
