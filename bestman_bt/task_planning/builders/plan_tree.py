"""Plans as steps, and trees that execute them, as self-contained XML and as nodes, and replan when they fail."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from string import ascii_lowercase
from typing import Any

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import NodeRegistry, Tree, XmlDocument, XmlElement, load_tree, tree_to_xml
from bestman_bt.engine.xml.document import XmlItem, XmlText
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic.problem import Action, Fact, Literal, TaskPlan

ABILITIES_FILE = "subtrees/abilities.xml"
"""The file of the shipped abilities, relative to the folder of trees."""
TREE_ID = "CarryOutPlan"


@dataclass(frozen=True)
class PlanTree:
    """A plan and its tree. ``element``: the root node of the tree; its abilities are SubTrees of ``ABILITIES_FILE`` or
    leaves.
    """

    plan: TaskPlan
    element: XmlElement

    def document(self) -> XmlDocument:
        """Return the tree as a document that includes the abilities' file."""
        tree = XmlElement("BehaviorTree", {"ID": TREE_ID}, [self.element])
        include = XmlElement("include", {"path": ABILITIES_FILE})
        root = XmlElement("root", {"BTCPP_format": "4", "main_tree_to_execute": TREE_ID}, [include, tree])
        return XmlDocument([_indented(root)], 'version="1.0" encoding="UTF-8"')

    def load(self, registry: NodeRegistry, **options: Any) -> Tree:
        """Return the loaded tree; ``options``: those of ``engine.load_tree``. Raises TreeLoadError."""
        return load_tree(self.document().to_xml(), registry, search_path=shipped_trees(), **options)

    def xml(self, registry: NodeRegistry) -> str:
        """Return a self-contained file with all called subtrees. Raises TreeLoadError."""
        return tree_to_xml(self.load(registry))


class Writer:
    """Creates the elements of one tree; ``leaves``: abilities that are leaves; all others are subtrees."""

    def __init__(self, leaves: Iterable[str] = ()) -> None:
        self._leaves = frozenset(leaves)
        self._names: dict[str, int] = {}

    def node(self, tag: str, name: str, children: Iterable[XmlElement] = (), **attributes: str) -> XmlElement:
        """Return a control node, decorator or leaf."""
        return XmlElement(tag, {"name": self._unique(name), **attributes}, list(children))

    def holds(self, name: str, literals: Iterable[Literal]) -> XmlElement:
        """Return a condition leaf for all of the literals; without literals, one that always succeeds."""
        literals = sorted(literals)
        if not literals:
            return self.node("AlwaysSuccess", name)
        return self.node("Holds", name, fact=" and ".join(str(literal) for literal in literals))

    def any_of(self, name: str, alternatives: Collection[Iterable[Literal]]) -> XmlElement:
        """Return a node that succeeds if one of several conjunctions of literals holds."""
        if len(alternatives) == 1:
            return self.holds(name, *alternatives)
        ways = [self.holds(f"{name}_{letter}", way) for letter, way in zip(ascii_lowercase, alternatives, strict=False)]
        return self.node("Fallback", name, ways)

    def step(self, number: int, step: PlanStep) -> XmlElement:
        """Return the node of a step: one action, or several in parallel."""
        actions = [self.action(number, action) for action in step.actions]
        if len(actions) == 1:
            return actions[0]
        return self.node("Parallel", f"{number}_side_by_side", actions, success_count="-1", failure_count="1")

    def action(self, number: int, action: Action) -> XmlElement:
        """Return the node of an action; with hold-conditions, below a guard that halts it."""
        name = f"{number}_{action.name}"
        if action.name in self._leaves:
            node = XmlElement(action.name, {"name": self._unique(name), **action.ports})
        else:
            node = XmlElement("SubTree", {"ID": action.name, "name": self._unique(name), **action.ports})
        if not action.hold:
            return node
        return self.node(
            "ReactiveSequence", f"{number}_guarded", [self.holds(f"{number}_may_go_on", action.hold), node]
        )

    def _unique(self, name: str) -> str:
        """Return unique names, since paths name nodes in logs and reports."""
        count = self._names[name] = self._names.get(name, 0) + 1
        return name if count == 1 else f"{name}_again_{count}"


def _indented(element: XmlElement, depth: int = 0) -> XmlElement:
    """Return the element with each of its children on a separate line."""
    content: list[XmlItem] = []
    for child in element.children:
        content += [XmlText("\n" + "    " * (depth + 1)), _indented(child, depth + 1)]
    if content:
        content.append(XmlText("\n" + "    " * depth))
    return XmlElement(element.tag, element.attributes, content)


PLAN_AND_EXECUTE_FILE = "plan_and_execute.xml"
RUN_ID = "PlannedRun"


def with_replanning(
    made: PlanTree,
    goal: Iterable[Literal],
    planner: str,
    builder: str,
    registry: NodeRegistry,
    limits: PlanLimits | None = None,
    replans: int = 20,
) -> str:
    """Return a self-contained file: first the checked plan, then, if it fails, ``ReachGoal``. Raises TreeLoadError.

    ``limits``: of the new plans. ``replans``: number of further plans after the first replanning.
    """
    facts = " and ".join(str(literal) for literal in goal)
    as_planned = XmlElement("SubTree", {"ID": TREE_ID, "name": "as_planned"})
    entries = {"goal": facts, "planner": planner, "builder": builder, "limits": (limits or PlanLimits()).to_string()}
    entries["replans"] = str(replans)
    anew = XmlElement("SubTree", {"ID": "ReachGoal", "name": "anew", **entries})
    either = XmlElement("Fallback", {"name": "as_planned_or_anew"}, [as_planned, anew])
    document = made.document()
    document.root.attributes["main_tree_to_execute"] = RUN_ID
    document.root.content.insert(0, XmlElement("include", {"path": PLAN_AND_EXECUTE_FILE}))
    document.root.content.append(XmlElement("BehaviorTree", {"ID": RUN_ID}, [either]))
    return tree_to_xml(load_tree(document.to_xml(), registry, search_path=shipped_trees()))


@dataclass(frozen=True)
class PlanStep:
    """One action, or several independent ones in parallel."""

    actions: tuple[Action, ...]

    def __str__(self) -> str:
        return " beside ".join(str(action) for action in self.actions)

    @property
    def pre(self) -> frozenset[Literal]:
        """The preconditions of the step."""
        return frozenset().union(*(action.pre for action in self.actions))

    @property
    def effects(self) -> frozenset[Literal]:
        """The effects of the step."""
        return frozenset().union(*(action.effects for action in self.actions))

    @property
    def alone(self) -> tuple[PlanStep, ...]:
        """The actions of a parallel step as separate steps, used when the other actions are done; empty for one
        action.
        """
        return tuple(PlanStep((action,)) for action in self.actions) if len(self.actions) > 1 else ()


def sequential_steps(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Return a step for each action."""
    return tuple(PlanStep((action,)) for action in plan.actions)


def parallel_steps(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Return parallel steps: each action is in the earliest step after all actions that it depends on.

    Two actions that depend on each other, or use the same part, keep their order.
    """
    steps: list[list[Action]] = []
    for action in plan.actions:
        last = max((i for i, step in enumerate(steps) if any(depend(other, action) for other in step)), default=-1)
        if last + 1 == len(steps):
            steps.append([])
        steps[last + 1].append(action)
    return tuple(PlanStep(tuple(step)) for step in steps)


def depend(first: Action, second: Action) -> bool:
    """Return whether the order of two actions matters; an action without declared parts may use any."""
    if not first.parts or not second.parts or set(first.parts) & set(second.parts):
        return True
    changes, needs = _changed(first), _needed(first)
    return bool(changes & (_changed(second) | _needed(second)) or needs & _changed(second))


def _changed(action: Action) -> frozenset[Fact]:
    return action.add | action.delete


def _needed(action: Action) -> frozenset[Fact]:
    return frozenset(literal.fact for literal in action.pre)
