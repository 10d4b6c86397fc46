"""Writes docs/skills.md: every skill of `behaviours/` by family, with its ports and an example.

Run it after a skill was added or changed: `.venv/bin/python scripts/skill_catalogue.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from behaviours.parts import parts_in_words
from bestman_bt.engine import NodeInfo, Port
from bestman_bt.runtime.plugins import node_registry

CHECKOUT = Path(__file__).resolve().parents[1]
PAGE = CHECKOUT / "docs" / "skills.md"
FAMILIES = {
    "Driving": "navigate stand localise explore",
    "Looking": "look scan search perceive second_look look_into",
    "Grasping and placing": "move_arm grasp check_held place place_in room_in_drawer",
    "Doors and drawers": "handles open close open_stand close_stand containers leaf_conditions",
    "Pushing": "push push_stand",
    "Tidying": "tidying task_goals",
    "Learned policies": "run_policy",
    "Beliefs": "blocked_places object_conditions",
    "Plans, stops and messages": "nodes conditions clear_stop log",
}
"""Family → the modules, by their last names, that its skills stand in."""
ELSEWHERE = ("bestman_bt.engine.", "behaviours.nav2.")
"""Nodes that have pages of their own."""

HEAD = """# Skills

What a tree of bestman-bt can do, family by family: each skill with its ports and an example. `bestman-bt nodes NAME`
prints the same of one skill, and of your own with `--plugin`. Control nodes, decorators and other built-in nodes are in
the [catalogue of the engine](engine/catalogue.md), the nodes of Nav2's files in [Nav2](nav2.md). An error code and a
message, `error_code` and `error_message`, are outputs of every skill.

Where a skill *requires* parts, a tree with it is refused on a robot that lacks one of them; what it *uses* may be
missing ([robots of any parts](robots.md#robots-of-any-parts)).

This page is generated from the skills by `scripts/skill_catalogue.py`.
"""
ALWAYS_THERE = ("error_code", "error_message")


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())
    print(PAGE.relative_to(CHECKOUT))


def page() -> str:
    """The whole page; KeyError where a skill is of no family."""
    family_of = {module: family for family, modules in FAMILIES.items() for module in modules.split()}
    skills: dict[str, list[NodeInfo]] = {family: [] for family in FAMILIES}
    for info in node_registry([]).manifest():
        module = info.cls.__module__
        if not module.startswith(ELSEWHERE):
            skills[family_of[module.rpartition(".")[2]]].append(info)
    used = {element.tag: element for element in shipped_elements()}
    parts = [HEAD]
    for family, infos in skills.items():
        parts.append(f"\n## {family}\n")
        parts += [section(info, used) for info in sorted(infos, key=lambda info: info.name)]
    return "".join(parts)


def section(info: NodeInfo, used: dict[str, ElementTree.Element]) -> str:
    """One skill."""
    text = f"\n### {info.name}\n\n{info.description.strip()}\n"
    if parts := parts_in_words(info.cls):
        text += f"\nOf the robot: {parts}.\n"
    rows = [_row(port) for name, port in info.ports.items() if name not in ALWAYS_THERE]
    if rows:
        text += "\n| port | | default | what it is |\n| --- | --- | --- | --- |\n" + "".join(rows)
    return text + f"\n```xml\n{example(info, used)}\n```\n"


def example(info: NodeInfo, used: dict[str, ElementTree.Element]) -> str:
    """As a shipped tree uses it, else with the ports that it requires."""
    element = used.get(info.name)
    ports = dict(element.attrib) if element is not None else {port: f"{{{port}}}" for port in info.required}
    written = "".join(
        f' {name}="{value}"' for name, value in ports.items() if name != "name" and not name.startswith("_")
    )
    return f"<{info.name}{written}/>"


def shipped_elements() -> Iterator[ElementTree.Element]:
    """All elements of the trees that are shipped."""
    for file in sorted((CHECKOUT / "trees").rglob("*.xml")):
        yield from ElementTree.parse(file).iter()


def _row(port: Port) -> str:
    default = "required" if port.required else "" if port.default is None else f"`{port.default}`"
    description = port.description.replace("|", "\\|")
    return f"| `{port.name}` | {port.direction}, {port.type_name} | {default} | {description} |\n"


if __name__ == "__main__":
    main()
