// Where the cards lie: d3-hierarchy's tidy tree (Reingold and Tilford; Buchheim et al. 2002), columns as wide as their widest card.

import { hierarchy, tree as tidyTree, type HierarchyPointNode } from "d3-hierarchy";
import { FONT } from "../theme";
import type { Tree, TreeNode } from "../tree";

export const CARD_HEIGHT = 36;
export const NAME_FONT = `600 12.5px ${FONT}`;
export const TYPE_FONT = `450 10.5px ${FONT}`;
const LEAST_WIDTH = 80;
const MOST_WIDTH = 184;
const ROW = 46;
const COLUMN_GAP = 30;
const LEVEL = 78;
const SIBLING_GAP = 14;
const GIST_WIDTH = 90;
const TEXT_LEFT = 34;
const TEXT_RIGHT = 12;

export type Orientation = "right" | "down";

export interface Card {
  index: number;
  x: number;
  y: number;
  width: number;
  name: string;
  kind: string;
  parent: Card | null;
  /** Nodes that the folded card hides. */
  hidden: number;
}

export interface Layout {
  cards: Card[];
  byIndex: Map<number, Card>;
  left: number;
  top: number;
  right: number;
  bottom: number;
  orientation: Orientation;
}

const ruler = document.createElement("canvas").getContext("2d")!;

function fitted(text: string, font: string, most: number): [string, number] {
  ruler.font = font;
  const width = ruler.measureText(text).width;
  if (width <= most) return [text, width];
  let low = 0;
  let high = text.length;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (ruler.measureText(`${text.slice(0, middle)}…`).width <= most) low = middle;
    else high = middle - 1;
  }
  return [`${text.slice(0, low)}…`, most];
}

const texts = new Map<string, { text: string; width: number }>();

/** Measuring is the slow part of a layout, and names repeat. */
function measured(text: string, font: string, most = MOST_WIDTH - TEXT_LEFT - TEXT_RIGHT): { text: string; width: number } {
  const key = `${font}${most}${text}`;
  let known = texts.get(key);
  if (known === undefined) {
    const [short, width] = fitted(text, font, most);
    known = { text: short, width };
    if (texts.size > 8000) texts.clear();
    texts.set(key, known);
  }
  return known;
}

/** The second line of a card whose name says its type already. */
function gist(node: TreeNode): string {
  return Object.values(node.ports ?? {}).join(" ") || node.category;
}

export function layOut(tree: Tree, collapsed: ReadonlySet<number>, orientation: Orientation): Layout {
  const root = hierarchy(tree.nodes[0]!, (node) =>
    collapsed.has(node.index) ? [] : node.children.map((child) => tree.nodes[child]!),
  );
  const cards = new Map<number, Card>();
  root.each(({ data }) => {
    const name = measured(data.name, NAME_FONT);
    const type = data.type === data.name
      ? measured(gist(data), TYPE_FONT, Math.max(GIST_WIDTH, Math.floor(name.width) - 14))
      : measured(data.type, TYPE_FONT);
    const width = Math.max(LEAST_WIDTH, Math.ceil(Math.max(name.width, type.width + 14)) + TEXT_LEFT + TEXT_RIGHT);
    const hidden = collapsed.has(data.index) ? data.size : 0;
    cards.set(data.index, { index: data.index, x: 0, y: 0, width, name: name.text, kind: type.text, parent: null, hidden });
  });
  const card = (node: { data: { index: number } }): Card => cards.get(node.data.index)!;
  type Placed = HierarchyPointNode<TreeNode>;
  const near = (a: Placed, b: Placed): number => (a.parent === b.parent ? 0 : 8);
  const placed =
    orientation === "right"
      ? tidyTree<TreeNode>().nodeSize([1, 1]).separation((a, b) => ROW + near(a, b))(root)
      : tidyTree<TreeNode>()
          .nodeSize([1, 1])
          .separation((a, b) => (card(a).width + card(b).width) / 2 + SIBLING_GAP + near(a, b))(root);

  const columns: number[] = [];
  placed.each((node) => (columns[node.depth] = Math.max(columns[node.depth] ?? 0, card(node).width)));
  const starts = [0];
  columns.forEach((width, depth) => (starts[depth + 1] = starts[depth]! + width + COLUMN_GAP));

  const layout: Layout = { cards: [], byIndex: cards, left: Infinity, top: Infinity, right: -Infinity, bottom: -Infinity, orientation };
  placed.eachBefore((node) => {
    const at = card(node);
    at.parent = node.parent === null ? null : card(node.parent);
    at.x = orientation === "right" ? starts[node.depth]! : node.x - at.width / 2;
    at.y = orientation === "right" ? node.x - CARD_HEIGHT / 2 : node.depth * LEVEL;
    layout.cards.push(at);
    layout.left = Math.min(layout.left, at.x);
    layout.right = Math.max(layout.right, at.x + at.width);
    layout.top = Math.min(layout.top, at.y);
    layout.bottom = Math.max(layout.bottom, at.y + CARD_HEIGHT);
  });
  return layout;
}
