"""Examples: bestman-bt robots; bestman-bt robots --png robots.png; bestman-bt robots --json."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import Json, json_output
from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.errors import ConfigurationError


def command(
    png: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Write a sheet with all robots.")] = None,
    as_json: Json = False,
) -> None:
    """List robots, parts, and the possible combinations of parts."""
    from bestman_bt.robot_model.compose import load_robot_model
    from bestman_bt.runtime.robot_facts import describe_parts, describe_robot

    with json_output(as_json) as write:
        robots: list[dict[str, Any]] = []
        broken: dict[str, str] = {}
        for name in data_names("robot"):
            try:
                robots.append(describe_robot(load_robot_model(name)))
            except ConfigurationError as error:
                broken[name] = str(error)
        parts = describe_parts()
        by_kind: dict[str, list[dict[str, Any]]] = {}
        for part in parts:
            by_kind.setdefault(part["kind"], []).append(part)
        hands = [part["name"] for part in parts if part["end_effector"]]
        ways = list(itertools.product(*([p["name"] for p in by_kind.get(kind, [])] for kind in ("base", "arm")), hands))
        document: dict[str, Any] = {"robots": robots, "parts": parts, "combinations": ["+".join(way) for way in ways]}
        if broken:
            document["unavailable"] = broken
        if png is not None:
            document["picture"] = str(_sheet([robot["name"] for robot in robots], png))
        write(document)
        if not as_json:
            _print_text(robots, broken, by_kind, len(ways))
            if png is not None:
                print(f"\npicture: {png}")


def _sheet(names: list[str], png: Path) -> Path:
    from PIL import Image

    from bestman_bt.robot_model.compose import load_robot_model
    from bestman_bt.runtime.pictures import contact_sheet, robot_picture

    pictures = [(name, robot_picture(load_robot_model(name), 360, 420)) for name in names]
    Image.fromarray(contact_sheet(pictures)).save(png)
    return png


def _print_text(
    robots: list[dict[str, Any]], broken: dict[str, str], by_kind: dict[str, list[dict[str, Any]]], ways: int
) -> None:
    print("Robots, with the parts that skills find on them (the learned policies of policy_* move only diff_panda)")
    for robot in robots:
        drives = ", ".join(base["drive"] for base in robot["bases"].values()) or "fixed"
        arms = ", ".join(f"{arm['joints']} joints, reach {arm['reach_m']:.2f} m" for arm in robot["arms"].values())
        hands = ", ".join(f"{hand['kind']} {hand['max_width_m'] * 1e3:.0f} mm" for hand in robot["grippers"].values())
        facts = f"{drives}; {arms or 'no arm'}; {hands or 'no hand'}; {robot['mass_kg']:.0f} kg"
        print(f"  {robot['name']:<18} {facts}; {', '.join(robot['for_skills']) or 'none'}")
    for name, why in broken.items():
        print(f"  {name:<18} not available: {why}")
    print("\nParts")
    for kind, parts in by_kind.items():
        print(f"  {kind}")
        for part in parts:
            print(f"    {part['name']:<20} {part['description']}")
    print(
        f"\nAny base, arm and end effector can be combined, {ways} robots in all: bestman-bt robot show BASE+ARM+HAND"
    )
