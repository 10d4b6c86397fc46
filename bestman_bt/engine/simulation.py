"""Simulated runs of a tree: no waiting, deterministic, with or without the code of its leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Final

from bestman_bt.engine.authoring import build_tree
from bestman_bt.engine.clock import EngineClock, ManualClock
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.core.tree import StateChanges, Tree
from bestman_bt.engine.dataflow import SCRIPT_ATTRIBUTES, EntryUse, entry_uses
from bestman_bt.engine.errors import EngineError, NodeError
from bestman_bt.engine.leaves.blackboard import WasEntryUpdated
from bestman_bt.engine.loading import load_tree
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.models.node_models import GUESS, PlaceholderControl, PlaceholderDecorator
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.scenario import Scenario, SimulatedLeaves, plausible_value
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.engine.substitution import SubstitutionRules
from bestman_bt.engine.unwritten import unwritten_reads
from bestman_bt.engine.xml.writer import tree_to_xml

LIMIT: Final = 600.0
"""Default time limit of a run, simulated seconds."""
MAX_TICKS: Final = 100_000
"""Largest number of ticks: in a tree that keeps waking itself up, no time passes."""


@dataclass(frozen=True)
class SimulatedRun:
    """The result of a simulated run: last status, simulated seconds, state changes as (time, path, state), tree.

    ``error``: the message if a node could not execute. ``simulated``: in a run with a scenario, the types of simulated
    leaves, each with the source of its description. ``transitions``: the changes as (number of the node, state).
    ``invented``: unwritten entries that got a plausible value of their port's type.
    """

    status: int
    seconds: float
    changes: list[tuple[float, str, int]]
    tree: Tree
    ticks: int = 0
    error: str = ""
    simulated: Mapping[str, str] = field(default_factory=dict)
    transitions: list[tuple[int, int]] = field(default_factory=list)
    invented: list[str] = field(default_factory=list)

    @property
    def succeeded(self) -> bool:
        """Whether the tree ended with SUCCESS."""
        return self.status == SUCCESS

    @property
    def outcome(self) -> str:
        """``success``, ``failure``, ``skipped``, ``error`` or ``time limit``."""
        if self.error:
            return "error"
        return {SUCCESS: "success", FAILURE: "failure", RUNNING: "time limit"}.get(self.status, "skipped")

    def visited(self, path: str) -> bool:
        """Return whether the node with this path ever left IDLE."""
        return any(found == path for _, found, _ in self.changes)

    def _repr_svg_(self) -> str:
        """Return the tree, coloured by the last results, for display in notebooks."""
        return self.tree._repr_svg_()

    def _repr_html_(self) -> str:
        """Return the outcome above the tree."""
        words = f"{self.outcome} after {self.seconds:.2f} s, {self.ticks} ticks. {self.error}"
        return f"<p>{escape(words)}</p>{self.tree._repr_html_()}"

    @property
    def order(self) -> list[str]:
        """The paths of the nodes in the order in which they started, repeated for each start."""
        states: dict[str, int] = {}
        began = []
        for _, path, state in self.changes:
            if state != IDLE and states.get(path, IDLE) == IDLE:
                began.append(path)
            states[path] = state
        return began

    @property
    def halted(self) -> list[str]:
        """The paths of the nodes that were halted while RUNNING, repeated for each halt."""
        states: dict[str, int] = {}
        found = []
        for _, path, state in self.changes:
            if state == IDLE and states.get(path) == RUNNING:
                found.append(path)
            states[path] = state
        return found


def simulate(  # noqa: PLR0913 - each by its name
    source: str | Path | Node,
    registry: NodeRegistry | None = None,
    *,
    entries: Mapping[str, Any] | None = None,
    context: Any = None,
    substitutions: SubstitutionRules | None = None,
    period: float = 0.05,
    limit: float = LIMIT,
    scenario: Scenario | None = None,
    seed: int = 0,
    package: Package | None = None,
    search_path: Iterable[Path] = (),
    main_tree: str | None = None,
    clock: EngineClock | None = None,
    drive: Callable[[Tree], tuple[int, int]] | None = None,
) -> SimulatedRun:
    """Load a tree, tick it until it ends, and return the run.

    Args:
        source: a file, XML text, or the root of a tree made in Python.
        registry: the nodes that it may name.
        entries: root entries to set before the first tick.
        context: the context of the nodes.
        substitutions: nodes to replace, for instance by TestNodes with delays.
        period: simulated seconds between ticks.
        limit: simulated seconds after which the tree is halted; its status is then RUNNING.
        scenario: behaviour of the leaves; with it all leaves are simulated, even those with code. The engine's own
            nodes (scripts, Sleep, blackboard) are executed. A node that cannot execute ends the run with ``error``.
        seed: of the random behaviour.
        package: other files that contain SubTrees and models of nodes.
        search_path: folders that includes may use.
        main_tree: the tree to run, if the file holds several.
        clock: replaces the simulated clock; for use with ``drive``.
        drive: ticks the tree to its end instead of using ``period`` and ``limit``, and returns its last status and the
            number of ticks.

    Raises:
        TreeLoadError: the tree does not load.
    """
    clock = clock or ManualClock()
    began = clock.now()
    leaves = SimulatedLeaves(scenario or Scenario(), seed)
    if scenario is None:
        options: dict[str, Any] = {"context": context, "clock": clock, "substitutions": substitutions}
        if isinstance(source, Node):
            tree = build_tree(source, registry=registry, **options)
        else:
            tree = load_tree(source, registry, main_tree=main_tree, search_path=search_path, **options)
    else:
        tree = open_tree(
            _as_xml(source, registry), _with_enums(registry, scenario), gaps=leaves, clock=clock, package=package,
            context=context, search_path=search_path, main_tree=main_tree,
            substitutions=substitutions or scenario.substitutions,
        )  # fmt: skip
    for key, value in {**(scenario.entries if scenario else {}), **(entries or {})}.items():
        tree.blackboard.set(key, value)
    invented = [] if scenario is None else _invent_entries(tree)
    changes: list[tuple[float, str, int]] = []
    transitions: list[tuple[int, int]] = []

    def listen(batch: StateChanges) -> None:
        found = list(batch)
        transitions.extend(found)
        changes.extend((batch.stamp, tree.nodes[uid - 1].path, state) for uid, state in found)

    tree.subscribe(listen)
    status, ticks, error = RUNNING, 0, ""
    try:
        status, ticks = _ticked(tree, period, limit) if drive is None else drive(tree)
    except EngineError as failure:
        if scenario is None:
            raise
        error = describe_failure(failure)
    tree.unsubscribe(listen)
    seconds = clock.now() - began
    return SimulatedRun(status, seconds, changes, tree, ticks, error, leaves.simulated, transitions, invented)


def _ticked(tree: Tree, period: float, limit: float) -> tuple[int, int]:
    """Tick until the tree ends, or the time is over."""
    status, ticks = RUNNING, 0
    while status == RUNNING and ticks < MAX_TICKS and tree.clock.now() < limit:
        if ticks:
            tree.sleep(period)
        status = tree.tick_exactly_once()
        ticks += 1
    if status == RUNNING:
        tree.halt()
    return status, ticks


def describe_failure(failure: EngineError) -> str:
    """Return the message of an error that ended a run, with the path of the last tick."""
    if not isinstance(failure, NodeError) or not failure.backtrace:
        return str(failure)
    return f"{failure} (the tick went through {' > '.join(failure.backtrace)})"


def _invent_entries(tree: Tree) -> list[str]:
    """Give entries that no node creates before they are needed a plausible value; returns their names."""
    uses = entry_uses(tree)
    texts = _texts(uses)
    created = _creators(tree, uses)
    needs = [use for use in uses if not use.creates and use.node.uid < created.get(id(use.slot), 0)]
    lacking = [(read.node, read.port, read.key) for read in unwritten_reads(tree)]
    lacking += [
        (use.node, use.port, use.key)
        for use in needs
        if use.port in SCRIPT_ATTRIBUTES or tree.info_of(use.node).builtin
    ]
    found = []
    for node, name, key in lacking:
        slot = node.board.slot_to_write(key)
        if slot.value is None and not isinstance(node, WasEntryUpdated):
            port = tree.info_of(node).ports.get(name)
            in_script = key_of(node.attributes.get(name), name) is None
            if id(slot) in texts:
                slot.assign(f"simulated {key}")
            else:
                slot.assign(0 if port is None or in_script else plausible_value(port))
            found.append(slot.key)
    return found


def _texts(uses: Iterable[EntryUse]) -> set[int]:
    """Return the entries that scripts use as texts, also by way of other entries."""
    alike: dict[int, set[int]] = {}
    for use in uses:
        alike.setdefault(id(use.slot), set()).update(map(id, use.alike))
    pending = [id(use.slot) for use in uses if use.is_text]
    texts = set[int]()
    while pending:
        slot = pending.pop()
        if slot not in texts:
            texts.add(slot)
            pending += alike.get(slot, ())
    return texts


def _creators(tree: Tree, uses: Iterable[EntryUse]) -> dict[int, float]:
    """Return for each written entry the number of the first node that creates it in simulation.

    It is 0 where a node certainly creates the entry, infinite where none does: simulated decorators and control nodes
    write nothing. Of a port whose direction is a guess it is not known.
    """
    found: dict[int, float] = {}
    for use in uses:
        if use.writes:
            info = tree.info_of(use.node)
            simulated = isinstance(use.node, (PlaceholderControl, PlaceholderDecorator))
            port = info.ports.get(use.port)
            is_guess = info.known_from == GUESS and port is not None and port.direction == "inout"
            uid = math.inf if simulated or not use.creates else use.node.uid if is_guess else 0
            found[id(use.slot)] = min(uid, found.get(id(use.slot), math.inf))
    return found


def _as_xml(source: str | Path | Node, registry: NodeRegistry | None) -> str | Path:
    """Return a tree made in Python as XML: its leaves get stand-ins as those of a file do."""
    if isinstance(source, Node):
        return tree_to_xml(build_tree(source, registry=registry))
    is_text = isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
    return tree_to_xml(load_tree(source, registry)) if not is_text and Path(source).suffix == ".py" else source


def _with_enums(registry: NodeRegistry | None, scenario: Scenario) -> NodeRegistry:
    registry = registry or NodeRegistry()
    for name, value in scenario.enums.items():
        registry.register_enum(name, value)
    return registry
