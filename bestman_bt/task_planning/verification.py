"""Checks before execution whether a tree is valid for a robot and its scene.

Ports, names and types; only abilities; the robot's capabilities; actions that need the same part at the same time;
hints on objects out of reach; finally a dry run on facts.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import (
    RUNNING,
    SUCCESS,
    Node,
    NodeRegistry,
    Parallel,
    ParallelAll,
    SubTree,
    Tree,
    TreeLoadError,
    TreeProblem,
    load_tree,
)
from bestman_bt.registry import suggestion
from bestman_bt.task_planning.builders.plan_tree import depend
from bestman_bt.task_planning.simulation import SymbolicWorld, dry_run
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import Action, Operator, PlanningError, PlanningProblem

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel
    from bestman_bt.world_model.world_model import WorldModel


def highest_reach(robot: RobotModel) -> float:
    """Return an upper bound of the height of the robot's tools, metres above the floor: the sum of link lengths and
    slides."""
    from bestman_bt.robot_model.model import ArmModel

    above = {}
    for joint in ElementTree.fromstring(robot.urdf).iter("joint"):
        child = joint.find("child")
        if child is not None:
            above[child.get("link", "")] = joint
    heights = [0.0]
    for arm in robot.of(ArmModel).values():
        height, frame = 0.0, arm.tool_frame
        while frame != robot.base_frame and frame in above:
            joint = above[frame]
            height += _length(joint)
            parent = joint.find("parent")
            frame = "" if parent is None else parent.get("link", "")
        heights.append(height)
    return max(heights)


def widest_grasp(robot: RobotModel) -> float:
    """Return the largest opening of the robot's hands, metres; infinite for a suction cup."""
    from bestman_bt.robot_model.model import GripperModel

    grippers = robot.of(GripperModel).values()
    return max((math.inf if gripper.part.kind == "suction" else gripper.max_width for gripper in grippers), default=0.0)


def _length(joint: ElementTree.Element) -> float:
    origin, limit = joint.find("origin"), joint.find("limit")
    offset = [float(number) for number in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
    slide = 0.0
    if joint.get("type") == "prismatic" and limit is not None:
        slide = max(abs(float(limit.get("lower", 0.0))), abs(float(limit.get("upper", 0.0))))
    return math.hypot(*offset) + slide


_HARMLESS = frozenset({"AlwaysSuccess", "AlwaysFailure", "Holds"})
"""Leaves that a tree of a plan may contain besides abilities."""


def verify(
    source: str | Path,
    problem: PlanningProblem,
    registry: NodeRegistry,
    robot: RobotModel | None = None,
    world: WorldModel | None = None,
) -> list[TreeProblem]:
    """Return all faults of a tree for a problem. Warnings are hints; with any other fault the tree must not run.

    ``source``: a file or XML text. ``robot``: checked for the required capabilities. ``world``: its beliefs, for hints.
    """
    try:
        tree = load_tree(source, registry, search_path=shipped_trees())
    except TreeLoadError as error:
        return list(error.problems)
    check = _Check(tree, problem, robot)
    faults = [*check.nodes(), *check.branches()]
    if not faults:
        faults += _dry_run(source, problem, registry)
    if robot is not None and world is not None:
        faults += _hints(tree, check.actions, robot, world)
    return faults


class _Check:
    """``actions``: the actions of the nodes of abilities, filled by ``nodes``."""

    def __init__(self, tree: Tree, problem: PlanningProblem, robot: RobotModel | None) -> None:
        self.tree = tree
        self.problem = problem
        self.operators = {operator.name: operator for operator in problem.operators}
        self.robot = robot
        self.actions: dict[Node, Action] = {}

    def nodes(self) -> Iterator[TreeProblem]:
        """Yield each node of the tree except those inside abilities."""
        for node in self.tree.nodes:
            if node.place is not None and self.operators.keys() & set(node.place.ancestors):
                continue
            operator = self.operators.get(node.type_id)
            if operator is not None:
                yield from self._ability(node, operator)
            elif not isinstance(node, SubTree) and not node.children and node.type_id not in _HARMLESS:
                yield _fault(node, "", "it is not an ability", suggestion(node.type_id, list(self.operators)))

    def branches(self) -> Iterator[TreeProblem]:
        """Check that parallel branches do not need the same part, nor change a fact that another one needs."""
        for node in self.tree.nodes:
            if not isinstance(node, (Parallel, ParallelAll)):
                continue
            branches = [self._below(child) for child in node.nodes_below()]
            for index, branch in enumerate(branches):
                for other in branches[index + 1 :]:
                    yield from self._conflicts(node, branch, other)

    def _ability(self, node: Node, operator: Operator) -> Iterator[TreeProblem]:
        faults = []
        for port, kind in operator.parameters.items():
            value = node.attributes.get(port)
            if value is None:
                faults.append(_fault(node, port, f"is missing; it takes a {kind}"))
            elif "{" in str(value):
                faults.append(_fault(node, port, f"{value} is known only at run time: it cannot be checked"))
            elif str(value) not in self.problem.objects:
                faults.append(_fault(node, port, f"unknown name {value!r}", self._closest(str(value), kind)))
        yield from faults
        yield from self._missing_parts(node, operator)
        if faults:
            return
        try:
            arguments = [str(node.attributes[port]) for port in operator.parameters]
            self.actions[node] = instantiate(self.problem, operator, arguments)
        except PlanningError as error:
            yield _fault(node, "", str(error))

    def _missing_parts(self, node: Node, operator: Operator) -> Iterator[TreeProblem]:
        if self.robot is None:
            return
        for part, needed in Counter(operator.parts).items():
            present = _count(self.robot, part)
            if present < needed:
                yield _fault(node, "", f"it needs {needed} × {part}, and {self.robot.name} has {present}")

    def _closest(self, name: str, kind: str) -> str:
        return suggestion(name, self.problem.of_type(kind))

    def _below(self, node: Node) -> list[Node]:
        found = [node] if node in self.actions else []
        for child in node.nodes_below():
            found += self._below(child)
        return found

    def _conflicts(self, parallel: Node, branch: list[Node], other: list[Node]) -> Iterator[TreeProblem]:
        for first in branch:
            for second in other:
                one, two = self.actions[first], self.actions[second]
                both = Counter(one.parts) + Counter(two.parts)
                robot = self.robot
                scarce = sorted(p for p, count in both.items() if count > (1 if robot is None else _count(robot, p)))
                if scarce:
                    yield _fault(parallel, "", f"{one} and {two} side by side both need the {scarce[0]}")
                elif depend(one, two) and not set(one.parts) & set(two.parts):
                    yield _fault(parallel, "", f"{one} and {two} side by side: one changes what the other needs")


def _count(robot: RobotModel, part: str) -> int:
    """Return how many of a kind of part, or of a name, a robot has."""
    from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel

    kinds = {"arm": ArmModel, "base": BaseModel, "hand": GripperModel, "head": JointGroupModel}
    kind = kinds.get(part)
    return int(part in robot.parts) if kind is None else sum(isinstance(p, kind) for p in robot.parts.values())


def _dry_run(source: str | Path, problem: PlanningProblem, registry: NodeRegistry) -> Iterator[TreeProblem]:
    world = SymbolicWorld(problem)
    run = dry_run(source, world, registry)
    missing = " and ".join(map(str, problem.unmet_in(world.state)))
    if run.status == RUNNING:
        yield TreeProblem(_name(source), 0, "", "", "the dry run does not end")
    elif run.status != SUCCESS:
        node, why = run.why[-1] if run.why else ("", "it fails")
        for path, words in reversed(run.why):
            if words.startswith("it needs"):  # an ability says more than the condition that failed after it
                node, why = path, words
                break
        yield TreeProblem(_name(source), 0, node, "", f"in a dry run it fails here: {why}")
    elif missing:
        yield TreeProblem(_name(source), 0, "", "", f"in a dry run the goal is not reached: {missing} does not hold")


def _hints(tree: Tree, actions: dict[Node, Action], robot: RobotModel, world: WorldModel) -> Iterator[TreeProblem]:
    """Yield warnings for objects that are higher than the arm reaches, or thicker than the open hand."""
    reach, grasp = highest_reach(robot), widest_grasp(robot)
    for node, action in actions.items():
        if "arm" not in action.parts:
            continue
        for port, kind in action.operator.parameters.items():
            name = action.ports[port]
            if kind == "place" and (height := _height(world, name)) is not None and height > reach:
                yield _fault(
                    node,
                    port,
                    f"{name} is {height:.2f} m high, the arm reaches up to {reach:.2f} m",
                    severity="warning",
                )
            belief = world.objects.get(name)
            model = belief.model if belief is not None else world.models.get(name)
            if kind == "object" and model is not None and min(model.size[:2]) > grasp:
                message = f"{name} is {min(model.size[:2]):.3f} m thick, the hand opens {grasp:.3f} m"
                yield _fault(node, port, message, severity="warning")


def _height(world: WorldModel, place: str) -> float | None:
    try:
        _, surface = world.surface(place)
    except KeyError:
        return None
    return float(surface.pose.position[2])


def _name(source: str | Path) -> str:
    return str(source) if isinstance(source, Path) or not source.lstrip().startswith("<") else "<text>"


def _fault(node: Node, field: str, message: str, hint: str = "", severity: str = "error") -> TreeProblem:
    file = "" if node.place is None else node.place.file
    return TreeProblem(file, node.line, node.path, field, message, hint, severity)
