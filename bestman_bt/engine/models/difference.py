"""Differences between two tree files: nodes added, removed, moved and changed, per tree.

Children are aligned in order so that as many as possible match, as in a text diff; a node removed in one place and
added in another counts as moved. Files are compared as text; the nodes need not be known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any, Final

from bestman_bt.engine.graphics import NodeBox, render_boxes
from bestman_bt.engine.models.node_models import KINDS
from bestman_bt.engine.xml.documents import Documents
from bestman_bt.engine.xml.elements import Element

MAX_PAIRS: Final = 250_000
"""Largest number of pairs of children of one node to compare; beyond it, only children at the same index."""
_COLOURS: Final = {
    "added": ("#dafbe1", "#1a7f37"),
    "removed": ("#ffebe9", "#cf222e"),
    "changed": ("#fff8c5", "#9a6700"),
    "moved": ("#ddf4ff", "#1f6feb"),
    "": ("#ffffff", "#8a8f98"),
}


@dataclass(eq=False)
class Pair:
    """A node before and after; None: absent. ``moved``: the pair of the same node on the other side."""

    before: Element | None
    after: Element | None
    children: list[Pair] = field(default_factory=list)
    moved: Pair | None = None

    @property
    def element(self) -> Element:
        """The node after the change, or before it if it was removed."""
        found = self.after if self.after is not None else self.before
        assert found is not None
        return found

    @property
    def label(self) -> str:
        """The type of the node, and its name, if any."""
        element = self.element
        kind = element.attributes.get("ID", element.tag) if element.tag in (*KINDS, "SubTree") else element.tag
        kind = f"SubTree {kind}" if element.tag == "SubTree" else kind
        name = element.attributes.get("name")
        return f"{kind} '{name}'" if name and name != kind else kind

    @property
    def ports(self) -> list[tuple[str, str | None, str | None]]:
        """The differing attributes, each with its text before and after."""
        old = (self.before or (self.moved.before if self.moved else None)) or Element("", {}, 0)
        new = (self.after or (self.moved.after if self.moved else None)) or Element("", {}, 0)
        keys = dict.fromkeys([*old.attributes, *new.attributes])
        pairs = [(key, old.attributes.get(key), new.attributes.get(key)) for key in keys]
        return [(key, one, two) for key, one, two in pairs if one != two]

    @property
    def kind(self) -> str:
        """``added``, ``removed``, ``moved``, ``changed`` or empty."""
        if self.moved is not None:
            return "moved"
        if self.before is None or self.after is None:
            return "added" if self.before is None else "removed"
        return "changed" if self.ports else ""

    def iter(self, above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Pair]]:
        """Yield this node and its descendants, each with the labels of its ancestors."""
        yield above, self
        for child in self.children:
            yield from child.iter((*above, self.label))


@dataclass(frozen=True)
class Difference:
    """One differing node, for text output and for programs; a line is 0 if the node is absent there."""

    kind: str
    tree: str
    path: str
    before_line: int
    after_line: int
    ports: list[tuple[str, str | None, str | None]]

    def __str__(self) -> str:
        ports = ", ".join(f"{key} {_quoted(old)} → {_quoted(new)}" for key, old, new in self.ports)
        lines = "line " + " → ".join(str(line) for line in (self.before_line, self.after_line) if line)
        what = f": {ports}" if ports and self.kind in ("changed", "moved") else ""
        return f"{self.kind:<8} {self.path} ({lines}){what}"


def _quoted(text: str | None) -> str:
    return "none" if text is None else f'"{text}"'


def compare(before: Documents, after: Documents) -> dict[str, Pair]:
    """Return the trees of two files by ID, with their differences; ``moved`` is determined within the file."""
    trees = {}
    prints: dict[int, int] = {}
    for tree_id in dict.fromkeys([*before.trees, *after.trees]):
        old, new = before.trees.get(tree_id), after.trees.get(tree_id)
        trees[tree_id] = _pair(old.element if old else None, new.element if new else None, prints)
    _find_moved(list(trees.values()), prints)
    return trees


def differences(trees: dict[str, Pair]) -> list[Difference]:
    """Return the differences in the order of the trees; for a subtree added or removed as a whole, only its root."""
    found = []
    for tree_id, root in trees.items():
        hidden: set[int] = set()
        for above, pair in root.iter():
            kind = pair.kind
            if id(pair) in hidden:
                hidden.update(id(child) for child in pair.children if child.kind == kind)
                continue
            if not kind or (kind == "moved" and pair.after is None):
                continue
            if kind != "changed":
                hidden.update(id(child) for child in pair.children if child.kind == kind)
            other = pair.moved or pair
            lines = [getattr(one, "line", 0) for one in (pair.before or other.before, pair.after or other.after)]
            path = " > ".join([*above[1:], pair.label]) if above else "the whole tree"
            found.append(Difference(kind, tree_id, path, lines[0], lines[1], pair.ports if kind != "removed" else []))
    return found


def difference_svg(trees: dict[str, Pair], title: str) -> str:
    """Return one SVG picture of the differing trees: green added, red removed, amber changed, blue moved."""
    roots = [_box(root) for root in trees.values() if any(pair.kind for _, pair in root.iter())]
    return render_boxes(roots or [NodeBox(["no difference"], "")], title)


def _box(pair: Pair) -> NodeBox:
    fill, stroke = _COLOURS[pair.kind]
    is_tree = pair.element.tag == "BehaviorTree"
    lines = [f"BehaviorTree {pair.element.attributes.get('ID', '')}" if is_tree else pair.label]
    if pair.kind in ("changed", "moved"):
        lines += [f"{key}: {_quoted(old)} → {_quoted(new)}" for key, old, new in pair.ports]
    children = [_box(child) for child in pair.children]
    return NodeBox(lines, pair.kind, fill, stroke, 2 if pair.kind else 1, pair.after is None, children)


def _pair(old: Element | None, new: Element | None, prints: dict[int, int]) -> Pair:
    for element in (old, new):
        if element is not None:
            _fingerprint(element, prints)
    before, after = ([] if element is None else element.children for element in (old, new))
    return Pair(old, new, [_pair(one, two, prints) for one, two in _aligned(before, after, prints)])


def _fingerprint(element: Element, prints: dict[int, int]) -> int:
    known = prints.get(id(element))
    if known is None:
        below = tuple(_fingerprint(child, prints) for child in element.children)
        known = prints[id(element)] = hash((element.tag, tuple(sorted(element.attributes.items())), below))
    return known


def _likeness(one: Element, two: Element, prints: dict[int, int]) -> int:
    """Return how much two nodes are the same; 0 where they are not."""
    if prints[id(one)] == prints[id(two)]:
        return 20
    if one.tag != two.tag or one.attributes.get("ID") != two.attributes.get("ID"):
        return 0
    names = one.attributes.get("name"), two.attributes.get("name")
    if all(names):
        return 8 if names[0] == names[1] else 1
    return 3


def _aligned(
    old: list[Element], new: list[Element], prints: dict[int, int]
) -> list[tuple[Element | None, Element | None]]:
    """Align children in their order so that the total similarity is greatest."""
    start = 0
    while start < min(len(old), len(new)) and prints[id(old[start])] == prints[id(new[start])]:
        start += 1
    aligned: list[tuple[Any, Any]] = list(zip(old[:start], new[:start], strict=True))
    old, new = old[start:], new[start:]
    if len(old) * len(new) > MAX_PAIRS:
        return [*aligned, *zip_longest(old, new)]
    best = [[0] * (len(new) + 1) for _ in range(len(old) + 1)]
    for i in range(len(old) - 1, -1, -1):
        for j in range(len(new) - 1, -1, -1):
            same = _likeness(old[i], new[j], prints)
            best[i][j] = max(best[i + 1][j], best[i][j + 1], best[i + 1][j + 1] + same if same else 0)
    i = j = 0
    while i < len(old) and j < len(new):
        same = _likeness(old[i], new[j], prints)
        if same and best[i][j] == best[i + 1][j + 1] + same:
            aligned.append((old[i], new[j]))
            i, j = i + 1, j + 1
        elif best[i][j] == best[i + 1][j]:
            aligned.append((old[i], None))
            i += 1
        else:
            aligned.append((None, new[j]))
            j += 1
    return [*aligned, *((element, None) for element in old[i:]), *((None, element) for element in new[j:])]


def _find_moved(roots: list[Pair], prints: dict[int, int]) -> None:
    """Join what was removed in one place and added in another: the same with all below, or of one type and name."""
    pairs = [pair for root in roots for _, pair in root.iter() if pair.element.tag != "BehaviorTree"]
    added: dict[Any, list[Pair]] = {}
    for pair in pairs:
        if pair.before is None:
            for key in _keys(pair.element, prints):
                added.setdefault(key, []).append(pair)
    for pair in pairs:
        if pair.after is not None or pair.moved is not None:
            continue
        for key in _keys(pair.element, prints):
            other = next((one for one in added.get(key, ()) if one.moved is None), None)
            if other is not None:
                pair.moved, other.moved = other, pair
                break


def _keys(element: Element, prints: dict[int, int]) -> list[Any]:
    name = element.attributes.get("name")
    same = [prints[id(element)]]
    return [*same, (element.tag, element.attributes.get("ID"), name)] if name else same
