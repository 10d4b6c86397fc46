"""Overview of a package of trees: its trees and their uses, as text, DOT or SVG."""

from __future__ import annotations

from collections.abc import Iterable

from bestman_bt.engine.core.registry import NodeInfo
from bestman_bt.engine.graphics import NodeBox, quoted, render_boxes
from bestman_bt.engine.models.package import Package


def overview_text(package: Package) -> str:
    """Return a line for each tree, grouped by file: its nodes, the trees that it uses, and its users."""
    uses = package.users()
    lines, file = [], ""
    for one in sorted(package.trees(), key=lambda one: (one.file, one.element.line)):
        if one.file != file:
            file = one.file
            lines.append(file)
        users = [outer for outer, inners in uses.items() if one.tree_id in inners and outer != one.tree_id]
        facts = [f"{sum(1 for _ in one.element.iter()) - 1} nodes"]
        if uses[one.tree_id]:
            facts.append("uses " + ", ".join(_counted(*used) for used in uses[one.tree_id].items()))
        facts.append("used by " + ", ".join(users) if users else "used by no other tree")
        lines.append(f"  {one.tree_id} (line {one.element.line}): {'; '.join(facts)}")
    return "\n".join(lines) + "\n"


def _counted(tree_id: str, count: int) -> str:
    return tree_id if count == 1 else f"{tree_id} ({count} times)"


def models_text(models: Iterable[NodeInfo]) -> str:
    """Return a line for each node that models describe, with its ports."""
    lines = []
    for info in sorted(models, key=lambda info: (info.kind, info.name)):
        lines.append(f"{info.kind} {info.name}: {' '.join(info.description.split())}".rstrip(": "))
        for port in info.ports.values():
            default = "" if port.default is None else f", {port.default_in_words}"
            words = " ".join(port.description.split())
            lines.append(
                f"    {port.name} ({port.direction}, {port.type_name}{default})" + (f": {words}" if words else "")
            )
    return "\n".join(lines) + "\n"


def models_svg(models: Iterable[NodeInfo]) -> str:
    """Return the nodes that models describe as an SVG picture, each with its ports."""
    infos = sorted(models, key=lambda info: (info.kind, info.name))
    return render_boxes(
        [NodeBox([f"{info.kind} {info.name}", *info.ports], info.description) for info in infos], "nodes"
    )


def overview_dot(package: Package) -> str:
    """Return the uses of trees in the DOT language; undefined trees are dashed."""
    lines = ["digraph trees {", "  rankdir=LR;", '  node [fontname="monospace", shape=folder];']
    uses = package.users()
    lines += [f"  {quoted(tree_id)};" for tree_id in uses]
    missing = sorted({inner for inners in uses.values() for inner in inners} - uses.keys())
    lines += [f"  {quoted(tree_id)} [style=dashed];" for tree_id in missing]
    for outer, inners in uses.items():
        lines.extend(f"  {quoted(outer)} -> {quoted(inner)};" for inner in inners)
    return "\n".join([*lines, "}"]) + "\n"


def overview_svg(package: Package) -> str:
    """Return the uses of trees as an SVG picture; a tree's SubTrees are drawn at its first occurrence."""
    uses, drawn = package.users(), set[str]()
    files = {one.tree_id: one.file for one in package.trees()}

    def box(tree_id: str) -> NodeBox:
        here = NodeBox(
            [tree_id], f"{tree_id}: {files.get(tree_id, 'not found')}", "#e7f5ea", dashed=tree_id not in uses
        )
        if tree_id in drawn and uses.get(tree_id):
            here.lines = [f"{tree_id} …"]
        elif tree_id not in drawn:
            drawn.add(tree_id)
            here.children = [box(inner) for inner in uses.get(tree_id, ())]
        return here

    roots = [box(one.tree_id) for one in package.roots()]
    roots += [box(tree_id) for tree_id in uses if tree_id not in drawn]  # those that use each other in a circle
    return render_boxes(roots or [NodeBox(["no trees"], "")], "trees")
