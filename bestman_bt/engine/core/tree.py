"""A loaded tree: the tick loop, halting, wake-ups, and the stream of state changes."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard as PyTreesBlackboard
from py_trees.composites import Selector
from py_trees.trees import setup as set_up_within
from py_trees.visitors import VisitorBase

from bestman_bt.engine.blackboard import Blackboard
from bestman_bt.engine.clock import EngineClock, WakeableClock, WallClock
from bestman_bt.engine.core.node import Node, wrapped
from bestman_bt.engine.core.strict_order import Stopping, set_order
from bestman_bt.engine.errors import EngineError, NodeError
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, NodeStatus, state_code, uid_and_state

if TYPE_CHECKING:
    from bestman_bt.engine.blackboard import SharedEntries
    from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
    from bestman_bt.engine.scripting.compiler import ScriptCompiler

_MEMBERS = tuple(NodeStatus)


SETUP_TIMEOUT: Final = 15.0
"""Longest setup of all native behaviours before the first tick, seconds of wall time."""
FRAMES_PER_LEVEL: Final = 8
"""Largest number of Python frames per node during a tick or halt."""
FRAMES_AROUND: Final = 500


class StateChanges(Sequence["tuple[int, int]"]):
    """The state changes of one tick or halt, in order, as ``(uid, new state)``; ``stamp`` is its clock time."""

    __slots__ = ("codes", "stamp")

    def __init__(self, stamp: float, codes: list[int]) -> None:
        self.stamp = stamp
        self.codes = codes

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [uid_and_state(code) for code in self.codes[index]]
        return uid_and_state(self.codes[index])

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return map(uid_and_state, self.codes)


Listener = Callable[[StateChanges], None]
InnerListener = Callable[["Tree", Node], None]


def _refused() -> int:
    raise EngineError("the execution was cancelled: no further node is ticked")


class Tree:
    """A tree that can be ticked. ``nodes`` are in construction order: the node with uid N is ``nodes[N - 1]``.

    ``shared``: synchronises its top blackboard with py_trees', or None if the tree has no native behaviour. ``origin``:
    the file or text that it was loaded from, and the search path of its includes; None for a tree made in Python.
    ``faulty_names``: entries and other names that appear in the faults of a tree that was loaded in spite of them.
    ``replaces``: while it is built, the tree whose blackboards it continues to use.
    ``to_xml``, ``to_svg``: write it, and draw it with the nodes' states.
    """

    def __init__(
        self,
        *,
        registry: NodeRegistry,
        compiler: ScriptCompiler,
        blackboard: Blackboard,
        tree_id: str,
        context: Any = None,
        clock: EngineClock | None = None,
        to_xml: Callable[[Tree], str],
        to_svg: Callable[[Tree, dict[int, int]], str],
    ) -> None:
        self.registry = registry
        self.compiler = compiler
        self.tree_id = tree_id
        self.context = context
        self.clock: EngineClock = clock if clock is not None else WallClock()
        self._to_xml, self._to_svg = to_xml, to_svg
        self.nodes: list[Node] = []
        self.blackboard = blackboard
        self.blackboards: dict[str, Blackboard] = {"": blackboard}
        self.subtree_ids: dict[str, str] = {"": tree_id}
        self.file = ""
        self.source = ""
        self.origin: tuple[str | Path, tuple[Path, ...]] | None = None
        self.faulty_names: set[str] = set()
        self.replaces: Tree | None = None
        self.shared: SharedEntries | None = None
        self.stopping = Stopping()
        self._status: int = IDLE
        self._root: Node | None = None
        self._wake = threading.Event()
        self._listeners: list[Listener] = []
        self._inner_listeners: list[InnerListener] = []
        self._log: list[Any] | None = None
        self._visited: list[Node] | None = None
        self._visitors: list[VisitorBase] = []
        self._binding = threading.RLock()  # monitors add hooks from threads of theirs
        self._bound = False
        self._plain = False  # bound, set up and without visitors
        self._set_up = True
        self._refusing = False

    @property
    def root(self) -> Node:
        """The root node."""
        if self._root is None:
            raise EngineError("the tree is empty")
        return self._root

    def complete(self, root: Node, depth: int, shared: SharedEntries | None) -> None:
        """Set the root and, if it has native behaviours below it, the shared entries.

        Raises the interpreter's recursion limit if a tree of this depth, with hooks and conditions, needs a higher one.
        """
        self._root = root
        set_order(self)
        self.shared = shared
        self._set_up = shared is None
        needed = FRAMES_PER_LEVEL * depth + FRAMES_AROUND
        if needed > sys.getrecursionlimit():
            sys.setrecursionlimit(needed)
        self.blackboard.store.now = self.clock.now()

    def info_of(self, node: Node) -> NodeInfo:
        """Return the registry's description of a node's class."""
        return node.info if node.info is not None else self.registry.info_of_class(type(node))

    def rebind(self) -> None:
        """Select each node's ``run`` function again after a change of listeners, visitors or hooks.

        Does nothing before the first tick, which selects them anyway. Thread-safe.
        """
        if self._bound:
            self._bind()

    def _bind(self) -> None:
        with self._binding:
            for node in reversed(self.nodes):
                node.bind(self._log, self._visited)
            self._bound = True
            self._plain = self._visited is None and not self._visitors and self._set_up
        if self._refusing:
            self._refuse()

    def _refuse(self) -> None:
        for node in self.nodes:
            node.refuse(_refused)

    def node(self, path: str) -> Node:
        """Return the node with this path.

        Raises:
            KeyError: no node has this path.
        """
        for node in self.nodes:
            if node.path == path:
                return node
        raise KeyError(f"there is no node '{path}' in the tree '{self.tree_id}'")

    @property
    def xml(self) -> str:
        """The tree as XML: its source text, or the writer's output for a tree built in Python."""
        return self.source or self._to_xml(self)

    def _repr_svg_(self) -> str:
        """Return the tree, coloured by the last results, for display in notebooks."""
        return self._to_svg(self, {node.uid: node.last_result for node in self.nodes})

    def _repr_html_(self) -> str:
        """Return the same, which scrolls where the tree is wider than the notebook."""
        return f'<div style="overflow-x: auto">{self._repr_svg_()}</div>'

    def as_subtree(self) -> Node:
        """Return a SubTree node of this tree, for the children of a node made in Python."""
        return self.registry.info("SubTree").cls(self)

    def bind(self, context: Any, clock: EngineClock) -> None:
        """Replace context and clock of the nodes; not while the tree is running."""
        self.context, self.clock = context, clock
        self.blackboard.store.now = clock.now()

    def setup(self, timeout: float = SETUP_TIMEOUT, **kwargs: Any) -> None:
        """Call the ``setup`` of native py_trees behaviours that are not set up, children first.

        The first tick does this if needed. Each gets ``kwargs``, and ``context`` and ``clock`` of the tree if its
        signature accepts them. ``timeout``: seconds of wall time for all of them; outside the main thread a slow setup
        is detected only after it has ended.

        Raises:
            NodeError: a setup failed or took too long; earlier ones stay set up, for ``shutdown``.
        """
        if self.shared is None:
            return
        if threading.current_thread() is threading.main_thread():
            set_up_within(self.root, timeout, **kwargs)
        else:
            end = time.monotonic() + timeout
            for node in self.root.iterate():
                node.setup(**kwargs)
                if time.monotonic() > end:
                    raise NodeError(f"setup() of the tree took longer than {timeout:g} s", node=node.name)
        self._set_up = True
        self.share_entries()

    def shutdown(self) -> None:
        """Call the ``shutdown`` of native py_trees behaviours that were set up; the next tick sets them up again.

        Raises:
            EngineError: listing every failed shutdown, after all have been called.
        """
        if self.shared is None:
            return
        faults = []
        for node in self.root.iterate():
            try:
                node.shutdown()
            except NodeError as error:
                faults.append(str(error))
        self._set_up = self._plain = False
        self.share_entries()
        if faults:
            raise EngineError("; ".join(faults))

    def share_entries(self) -> None:
        """Import the writes of native behaviours from py_trees' blackboard."""
        if self.shared is not None:
            self.shared.take_over()

    @property
    def status(self) -> NodeStatus:
        """Status of the root after the last tick; IDLE after a halt. Compares equal to the constants."""
        return _MEMBERS[self._status]

    def tick_exactly_once(self) -> NodeStatus:
        """Tick once, regardless of wake-ups, and return the root's status."""
        status = self._tick()
        return self._finished(status)

    def tick_once(self) -> NodeStatus:
        """Tick once, and again while the root is running and a node has woken the loop; return the root's status."""
        status = self._tick()
        while status == RUNNING and self._woken():
            status = self._tick()
        return self._finished(status)

    def tick_while_running(self, period: float = 0.05, max_ticks: int | None = None) -> NodeStatus:
        """Tick until the root is no longer running, sleeping ``period`` seconds of the clock between ticks.

        Args:
            period: seconds; a wake-up ends the sleep early if the clock supports it.
            max_ticks: return RUNNING after this many ticks; None: no limit.
        """
        ticks = 0
        while True:
            status = self.tick_once()
            ticks += 1
            if status != RUNNING or (max_ticks is not None and ticks >= max_ticks):
                return status
            self.sleep(period)

    def refuse_ticks(self) -> None:
        """Prevent every further tick of a node; the current tick ends with EngineError.

        Safe to call from any thread and from signal handlers. It adds no cost to ticks.
        """
        self._refusing = True
        if self._bound:
            self._refuse()

    def raise_if_refused(self) -> None:
        """Raise EngineError after ``refuse_ticks``; for code that blocks a tick."""
        if self._refusing:
            _refused()

    def allow_ticks(self) -> None:
        """Undo ``refuse_ticks``."""
        if self._refusing:
            self._refusing = False
            self.rebind()

    def sleep(self, duration: float) -> None:
        """Wait for ``duration`` seconds of the clock, or until a wake-up."""
        if self._woken():
            return
        clock = self.clock
        if isinstance(clock, WakeableClock):
            clock.wait(duration, self._wake)
        else:
            clock.sleep(duration)
        self._woken()

    def wake_up(self) -> None:
        """End the loop's sleep. Thread-safe."""
        if not self._wake.is_set():
            self._wake.set()

    def wake_with(self, outer: Tree) -> None:
        """Wake up the loop of the tree that ticks this one, instead of this tree's own loop."""
        self._wake = outer._wake

    def _woken(self) -> bool:
        if self._wake.is_set():
            self._wake.clear()
            return True
        return False

    def _tick(self) -> int:
        if self._plain:
            return self._tick_bound()
        return self._tick_visited()

    def _tick_bound(self) -> int:
        root = self.root
        self._begin()
        try:
            status = root.run()
            if status == RUNNING:
                if root._s != RUNNING:
                    if root.SYNCHRONOUS:
                        root.refuse_running()
                    root.set_state(RUNNING)
            elif status != SKIPPED:
                root.set_state(status)
                root.reset_status()
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, root) from error
        finally:
            if self._log:
                self.publish()
        return status

    def _begin(self) -> None:
        store = self.blackboard.store
        store.now = self.clock.now()
        if self.stopping.until:
            self.stopping.ask(store.now)
        store.observed = PyTreesBlackboard.activity_stream is not None or bool(store.watchers)

    def _finished(self, status: int) -> NodeStatus:
        self._status = status
        return _MEMBERS[status]

    def halt(self) -> None:
        """Halt everything that is running, deepest first, and run the ``_onHalted`` scripts.

        Raises NodeError, after the others are halted, if a node could not be.
        """
        if not self._bound:
            self._bind()
        self._begin()
        failures = []
        try:
            for node in (self.root, *self.nodes):
                try:
                    node.halt_node()
                except NodeError as error:
                    failures.append(error)
            self.root.reset_status()
        finally:
            if self._log:
                self.publish()
        for node in self.nodes:
            node._s = IDLE
        self._status = IDLE
        if failures:
            raise failures[0]

    def wait_until_stopped(self, period: float = 0.05) -> None:
        """Wait, after a halt, until no action is stopping, or until its time limit has passed."""
        while self.stopping.until:
            self.clock.sleep(period)
            self._begin()

    def tick_as_behaviour(self, node: Node) -> Iterator[Behaviour]:
        """Tick ``node`` for py_trees and yield the visited nodes, children before parents."""
        visited = self._visit()
        self._begin()
        try:
            status = node.execute_tick()
            if status in (SUCCESS, FAILURE):
                node.reset_status()
        finally:
            if self._log:
                self.publish()
        if status == SKIPPED:
            node._s = -FAILURE if isinstance(node.parent, Selector) else -SUCCESS
        if node is self._root:
            self._status = status
        yield from list(visited)

    def add_visitor(self, visitor: VisitorBase) -> None:
        """Pass every node that a tick visits to a py_trees visitor, after the tick."""
        self._visitors.append(visitor)
        self._plain = False

    def remove_visitor(self, visitor: VisitorBase) -> None:
        """Remove a py_trees visitor; without visitors, ticks have no extra cost."""
        self._visitors.remove(visitor)

    def _visit(self) -> list[Node]:
        if self._visited is None:
            self._visited = []
            self._bind()
        self._visited.clear()
        return self._visited

    def _tick_visited(self) -> int:
        if not self._set_up:
            self.setup()
        if not self._visitors:
            self._visited = None
            self._bind()
            return self._tick_bound()
        visited = self._visit()
        for visitor in self._visitors:
            visitor.initialise()
        status = self._tick_bound()
        for visitor in self._visitors:
            for node in self.nodes if visitor.full else visited:
                visitor.run(node)
            visitor.finalise()
        return status

    def subscribe(self, listener: Listener) -> None:
        """Call ``listener`` with the ``StateChanges`` of each tick or halt that changes a state."""
        self._listeners.append(listener)
        if self._log is None:
            self._log = []
            self.rebind()

    def unsubscribe(self, listener: Listener) -> None:
        """End a subscription; without listeners, ticks have no extra cost."""
        if listener in self._listeners:
            self._listeners.remove(listener)
        if not self._listeners and self._log is not None:
            self._log = None
            self.rebind()

    def subscribe_to_inner(self, listener: InnerListener) -> None:
        """Call ``listener`` with each inner tree that a leaf itself is about to tick, and with the leaf."""
        self._inner_listeners.append(listener)

    def unsubscribe_from_inner(self, listener: InnerListener) -> None:
        """End a subscription to inner trees."""
        if listener in self._inner_listeners:
            self._inner_listeners.remove(listener)

    def announce_inner(self, inner: Tree, leaf: Node) -> None:
        """Notify the listeners of an inner tree of ``leaf``, before its first tick."""
        for listener in tuple(self._inner_listeners):
            listener(inner, leaf)

    def publish_idle(self) -> None:
        """Notify the listeners that all nodes are idle, because another tree replaces this one."""
        if self._log is not None:
            self._log += [state_code(node.uid, IDLE) for node in self.nodes if node.state != IDLE]
            self.publish()
        self._status = IDLE

    def publish(self) -> None:
        """Send the state changes so far to the listeners; called after each tick and halt, and optionally during long
        ticks.
        """
        log = self._log
        if not log:
            return
        changes = StateChanges(self.blackboard.store.now, log.copy())
        log.clear()
        for listener in tuple(self._listeners):
            listener(changes)
