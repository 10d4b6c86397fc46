"""Dry runs of a tree without a robot: its abilities change a set of facts as declared."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeGuard

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    Condition,
    In,
    ManualClock,
    Node,
    NodeRegistry,
    PortInformation,
    StatefulAction,
    Tree,
    XmlDocument,
    XmlElement,
    load_tree,
)
from bestman_bt.task_planning.builders.plan_tree import ABILITIES_FILE, PlanTree
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.plan_check import broken_in, state_after
from bestman_bt.task_planning.symbolic.problem import Action, Fact, Formula, Operator, PlanningError, PlanningProblem

MAX_TICKS = 10_000
"""Number of ticks after which a tree counts as not ending."""


@dataclass
class SymbolicWorld:
    """The state of a symbolic simulation: true facts and executed actions. ``done``: succeeded; ``failures``:
    (path, reason)."""

    problem: PlanningProblem
    state: frozenset[Fact] = field(init=False)
    done: list[Action] = field(default_factory=list)
    failures: list[tuple[str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.state = self.problem.state

    def believed(self) -> frozenset[Fact]:
        """Return the facts that conditions see."""
        return self.state

    def begin(self, action: Action) -> tuple[Formula, ...]:
        """Return the violated preconditions of an action."""
        return broken_in(self.problem, action.operator, action.arguments, self.state)

    def finish(self, action: Action) -> str:
        """Apply the effects of an action; return why it fails, or an empty text."""
        self.state = state_after(self.problem, action.operator, action.arguments, self.state)
        self.done.append(action)
        return ""

    @property
    def reached(self) -> bool:
        """Return whether the goal holds."""
        return not self.problem.unmet_in(self.state)


class SimulatedAbility(StatefulAction):
    """A simulated ability: runs for a tick, then changes the world. The tree's context is a ``SymbolicWorld``."""

    OPERATOR: ClassVar[Operator]

    _action: Action

    def on_start(self) -> int:
        """Start; FAILURE if a precondition is violated."""
        world: SymbolicWorld = self.context
        try:
            arguments = [str(self.get_input(port)) for port in self.OPERATOR.parameters]
            self._action = instantiate(world.problem, self.OPERATOR, arguments)
        except PlanningError as error:
            return self._fail(str(error))
        broken = world.begin(self._action)
        return self._fail(f"it needs {' and '.join(map(str, broken))}") if broken else RUNNING

    def on_running(self) -> int:
        """Apply the effects and return SUCCESS, unless the world refuses."""
        why = self.context.finish(self._action)
        return self._fail(why) if why else SUCCESS

    def _fail(self, why: str) -> int:
        self.context.failures.append((_path_of_ability(self), why))
        return FAILURE


class SimulatedHolds(Condition):
    """The condition ``Holds`` on a ``SymbolicWorld``."""

    fact = In(str, "facts, joined by 'and'")

    def on_load(self) -> None:
        """Parse the facts."""
        self._literals = parse_literals(str(self.attributes["fact"]))

    def on_tick(self) -> int:
        """Return SUCCESS if all facts hold."""
        state = self.context.believed()
        missing = [literal for literal in self._literals if not literal.holds_in(state)]
        if missing:
            self.context.failures.append((self.path, f"{' and '.join(map(str, missing))} does not hold"))
        return FAILURE if missing else SUCCESS


@dataclass(frozen=True)
class DryRun:
    """The result of a simulation. ``status``: that of the tree; RUNNING if it did not end. ``why``: the last failures
    as (node, reason), latest last.
    """

    status: int
    reached: bool
    done: tuple[Action, ...]
    why: tuple[tuple[str, str], ...]


def dry_run(source: str | Path, world: SymbolicWorld, registry: NodeRegistry, max_ticks: int = MAX_TICKS) -> DryRun:
    """Tick a tree to its end in a symbolic world. Raises TreeLoadError."""
    tree = load_simulated(source, world, registry)
    status = tree.tick_while_running(max_ticks=max_ticks)
    if status == RUNNING:
        tree.halt()
    return DryRun(status, world.reached, tuple(world.done), tuple(world.failures))


def load_simulated(source: str | Path, world: SymbolicWorld, registry: NodeRegistry) -> Tree:
    """Return the tree with all abilities replaced by simulated ones. Raises TreeLoadError.

    ``source``: a file or XML text. ``registry``: further nodes; it is not changed.
    """
    operators = world.problem.operators
    simulated = NodeRegistry()
    for info in registry:
        if not info.builtin and info.name not in {"Holds", *(operator.name for operator in operators)}:
            simulated.register(info.cls, info.name)
    simulated.register(SimulatedHolds, "Holds")
    leaves = [operator for operator in operators if operator.name in registry]
    subtrees = [operator for operator in operators if operator.name not in registry]
    for operator in leaves:
        simulated.register(_leaf_of(operator), operator.name)
    for operator in subtrees:
        simulated.register(_leaf_of(operator), f"{operator.name}Simulated")
    text = _with_stubs(source, subtrees)
    folder = [Path(source).resolve().parent] if not _is_text(source) else []
    search_path = [*folder, *shipped_trees()]
    return load_tree(text, simulated, context=world, clock=ManualClock(), search_path=search_path)


def folded(made: PlanTree, problem: PlanningProblem) -> Tree:
    """Return the tree of a plan for display: each ability is one leaf."""
    names = {operator.name for operator in problem.operators}
    registry = NodeRegistry()
    for operator in problem.operators:
        registry.register(_leaf_of(operator), operator.name)
    document = made.document()
    for element in document.root.iter():
        if element.tag == "SubTree" and element.attributes["ID"] in names:
            element.tag = element.attributes["ID"]
            element.attributes = {key: value for key, value in element.attributes.items() if key != "ID"}
    return load_simulated(document.to_xml(), SymbolicWorld(problem), registry)


def _leaf_of(operator: Operator) -> type[Node]:
    """Return a leaf with the ports of an ability; other ports of the real one may be given and do nothing."""
    ports = {name: PortInformation(str, description=kind) for name, kind in operator.parameters.items()}
    made: dict[str, Any] = {"OPERATOR": operator, "INPUT_PORTS": ports, "__doc__": SimulatedAbility.__doc__}
    return type(operator.name, (SimulatedAbility,), made)


def _with_stubs(source: str | Path, subtrees: Sequence[Operator]) -> str:
    """Return the file's XML with the definitions of abilities replaced."""
    document = XmlDocument.parse(source) if _is_text(source) else XmlDocument.load(source)
    names = {operator.name for operator in subtrees}
    root = document.root
    root.content = [item for item in root.content if not (isinstance(item, XmlElement) and _is_replaced(item, names))]
    root.content += [_stub(operator) for operator in subtrees]
    return document.to_xml()


def _is_text(source: str | Path) -> TypeGuard[str]:
    return isinstance(source, str) and source.lstrip().startswith("<")


def _is_replaced(element: XmlElement, names: Collection[str]) -> bool:
    match element.tag:
        case "include":
            return element.attributes.get("path") == ABILITIES_FILE
        case "BehaviorTree":
            return element.attributes.get("ID", "") in names
        case _:
            return False


def _stub(operator: Operator) -> XmlElement:
    ports = {name: f"{{{name}}}" for name in operator.parameters}
    return XmlElement("BehaviorTree", {"ID": operator.name}, [XmlElement(f"{operator.name}Simulated", ports)])


def _path_of_ability(leaf: Node) -> str:
    """Return the path of the SubTree that a simulated leaf stands for, or of the leaf itself."""
    return leaf.place.prefix.removesuffix("/") if leaf.place is not None and leaf.place.prefix else leaf.path
