"""Checks of a tree against the setup: unknown names, and entries that are never filled."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from behaviours.parts import listed, parts_by_kind
from behaviours.skill import ArmNode
from bestman_bt.engine import Node, Tree
from bestman_bt.engine.bounds import Named
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.dataflow import EntryUse, entry_uses
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.leaves.blackboard import SetBlackboard
from bestman_bt.engine.unwritten import may_write_undeclared, named_at, problem_at, unwritten_reads
from bestman_bt.registry import suggestion

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel
    from bestman_bt.world_model.world_model import WorldModel

TASK_ENTRIES = (
    *("object", "source", "target", "goal", "goals", "objects", "region_x", "region_y"),
    *("articulation", "furniture", "at_least", "at_most", "front", "top", "inside", "views"),
    *("planner", "builder", "limits", "replans"),
)
"""Root entries that a task, or ``bestman-bt look``, fills before the first tick."""

ALWAYS_FILLED = ("start",)
"""Root entries that a session fills, whatever the task."""

_IDENTITY = re.compile(r"(.+)_\d+")
"""Names of one of several equal objects, and of unknown objects: ``can_2``, ``thing_1``."""


def known_names(world: WorldModel, absent: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the names of the world that ports may use, by kind.

    ``absent``: objects missing from the scene, which a tree may still search for.
    """
    pieces = world.map.furniture
    return {
        "object": [*world.models, *absent],
        "furniture": list(pieces),
        "surface": [*pieces, *(f"{name}/{one.name}" for name, piece in pieces.items() for one in piece.surfaces)],
        "articulation": [f"{name}/{door.name}" for name, piece in pieces.items() for door in piece.articulations],
    }


def lacking_parts(tree: Tree, robot: RobotModel, there: Collection[str]) -> list[TreeProblem]:
    """Return a problem for each node that requires a part (``REQUIRES``) which the robot lacks.

    ``there``: names of the available parts; the other parts of a real robot have no connection. If empty, the fault is
    in the robot's file, not in the tree.
    """
    if robot.parts and not there:
        return []
    has = parts_by_kind(robot, there)
    problems = []
    for node in tree.nodes:
        lacking = [kind for kind in getattr(node, "REQUIRES", ()) if kind not in has]
        if lacking:
            message = (
                f"{node.path} needs {listed(lacking)}; robot {robot.name} has {', '.join(has) or 'none of that kind'}"
            )
            unconnected = [kind for kind in lacking if kind in parts_by_kind(robot, robot.parts)]
            if unconnected:
                message += f", and its {' and '.join(unconnected)} without a connection"
            problems.append(problem_at(node, "", message, ""))
    return problems


def arm_problems(tree: Tree, robot: RobotModel) -> list[TreeProblem]:
    """Return a problem for each node that names an unknown arm or one without a hand, or names none of several arms.

    Robots without an arm are checked by ``lacking_parts``.
    """
    arms = robot.arm_names
    problems = unknown_names(tree, {"arm": arms}) if arms else []
    if len(arms) < 2:
        return problems
    written = {id(use.slot) for use in entry_uses(tree) if use.writes}
    for node in tree.nodes:
        if not isinstance(node, ArmNode) and "arm" not in getattr(node, "REQUIRES", ()):
            continue
        value: str = node.attributes.get("arm", "")
        key = key_of(value, "arm")
        if key is not None:
            slot = node.board.slot(key)
            if id(slot) in written:
                continue
            value = slot.value or ""
        arm = value or robot.default_arm
        if arm is None:
            message = f"{node.path} names no arm; robot {robot.name} has {', '.join(arms)} and no default_arm"
            hint = f'give arm="{arms[0]}"' if isinstance(node, ArmNode) else f"give the robot a default_arm: {arms[0]}"
            problems.append(problem_at(node, "arm", message, hint))
        elif arm in arms and "gripper" in getattr(node, "REQUIRES", ()) and robot.gripper_of(arm) is None:
            message = f"{node.path} needs a gripper, and the arm {arm} of robot {robot.name} carries none"
            problems.append(problem_at(node, "arm", message, ""))
    return problems


def unknown_names(tree: Tree, names: Mapping[str, Collection[str]]) -> list[TreeProblem]:
    """Return a problem for each literal of a ``Named`` port that names an unknown thing."""
    written = _literals_written(tree)
    found: dict[tuple[int, str, str], TreeProblem] = {}
    for node in tree.nodes:
        for name, port in tree.info_of(node).ports.items():
            kind = next((bound.kind for bound in port.bounds or () if isinstance(bound, Named)), None)
            if kind is None or kind not in names or port.direction == "output" or name not in node.attributes:
                continue
            for place, where, value in literals(node, name, tree, written):
                if not _is_known(kind, value, names[kind]):
                    message = f"there is no {_WORDS.get(kind, kind)} {value!r}"
                    problem = problem_at(place, where, message, suggestion(value, list(names[kind])))
                    found.setdefault((id(place), where, value), problem)
    return list(found.values())


_WORDS = {"articulation": "door or drawer", "furniture": "piece of furniture"}


def _is_known(kind: str, value: str, names: Collection[str]) -> bool:
    identity = _IDENTITY.fullmatch(value) if kind == "object" else None
    return not value or value in names or (identity is not None and identity[1] in (*names, "thing"))


def literals(
    node: Node, port: str, tree: Tree, written: Mapping[int, list[tuple[Node, str]]] | None = None
) -> Iterator[tuple[Node, str, str]]:
    """Yield the texts that a port may read according to the tree: node, attribute and text.

    ``written``: slot → the texts that nodes write there, each with its node; without it, written texts are not
    considered.
    """
    value = node.attributes[port]
    key = key_of(value, port)
    if key is None:
        if isinstance(value, (str, int, float)):  # a number, in a tree made in Python, is not a name either
            yield node, port, str(value)
        return
    slot = node.board.slot(key)
    if isinstance(slot.value, str):
        place, where, _ = named_at(tree, EntryUse(slot, node, port, key, writes=False))
        yield place, where, slot.value
    for writer, text in (written or {}).get(id(slot), ()):
        yield writer, "value", text


def _literals_written(tree: Tree) -> dict[int, list[tuple[Node, str]]]:
    """Return, by slot, the texts that SetBlackboard writes to it, with the node."""
    written: dict[int, list[tuple[Node, str]]] = {}
    for node in tree.nodes:
        value, target = node.attributes.get("value"), node.attributes.get("output_key")
        if isinstance(node, SetBlackboard) and isinstance(value, str) and key_of(value, "value") is None:
            slot = node.board.slot(key_of(target, "output_key") or str(target))
            written.setdefault(id(slot), []).append((node, value))
    return written


def unfilled_entries(tree: Tree, given: Collection[str], has_task: bool) -> list[TreeProblem]:
    """Return problems for entries that are read before they are filled; errors if the read fails, else warnings.

    ``given``: root entries set before the first tick, by a task, if any. If code may write undeclared entries, all are
    warnings.
    """
    unseen = any(may_write_undeclared(node) for node in tree.nodes)
    problems = []
    for read in unwritten_reads(tree, [*given, *ALWAYS_FILLED]):
        if read.key in tree.faulty_names:
            continue
        why = ""
        if read.key in TASK_ENTRIES and read.later is None and not (read.suggestion or read.not_given):
            why = "which is not filled by the task" if has_task else "which tasks fill, but no task is given"
        problems.append(read.problem("error" if read.fails and not unseen else "warning", why))
    return problems
