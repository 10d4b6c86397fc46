"""Breakpoints on nodes and forced results, implemented by hooks around the nodes' ticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS, EngineError, Node
from bestman_bt.engine.spelling import closest
from bestman_bt.errors import Error
from bestman_bt.runtime.executor import Executor, PauseReason

When = Literal["before", "after"]
RESULTS = {"SUCCESS": SUCCESS, "FAILURE": FAILURE}


class BreakpointError(Error):
    """A breakpoint or forced result is invalid."""


@dataclass(eq=False)
class Breakpoint:
    """``condition``: a script that must be true, in the scope of the node; ``once``: cleared when hit."""

    node: Node
    when: When
    condition: str | None
    once: bool
    holds: Callable[[], bool] | None = None
    held: bool = False

    def met(self, begins_or_ends: bool) -> bool:
        """Return whether the execution must pause now.

        Without a condition: when the node starts, or has its result. With one: at the first tick at which it becomes
        true.
        """
        if self.holds is None:
            return begins_or_ends
        before = self.held
        try:
            self.held = self.holds()
        except EngineError:  # an entry that is not there yet
            self.held = False
        return self.held and not before

    def document(self) -> dict[str, Any]:
        """Return the breakpoint as a document for the control channel."""
        return {
            "node": self.node.uid,
            "path": self.node.path,
            "when": self.when,
            "condition": self.condition,
            "once": self.once,
        }


class Breakpoints:
    """The breakpoints of one executor's tree. All methods except ``documents`` belong to the executor's thread.

    ``changed``: called after a breakpoint was set, cleared or used up. Nodes are given by uid or path.
    """

    def __init__(self, executor: Executor, changed: Callable[[], None]) -> None:
        self._executor = executor
        self._changed = changed
        self._breakpoints: dict[tuple[Node, When], Breakpoint] = {}
        self._forced: dict[Node, int] = {}

    def documents(self) -> list[dict[str, Any]]:
        """Return all breakpoints as documents."""
        return [breakpoint.document() for breakpoint in list(self._breakpoints.values())]

    def add(self, node: int | str, when: str, condition: str | None = None, once: bool = False) -> None:
        """Set a breakpoint; it replaces another one at the same place.

        Raises:
            BreakpointError: node, moment or condition is invalid.
            ScriptError: the condition does not compile.
        """
        found, moment = self._node(node), self._when(when)
        if not isinstance(condition, str | None):
            raise BreakpointError(f"a condition should be a script, got {condition!r}")
        made = Breakpoint(found, moment, condition or None, once)
        if made.condition is not None:
            made.holds = found.owner.compiler.compile_condition(made.condition, found.board)
        self._breakpoints[found, moment] = made
        self._hook(found)
        self._changed()

    def clear(self, node: int | str | None = None, when: str | None = None) -> None:
        """Clear one breakpoint; without ``when`` both of the node, without ``node`` all."""
        found = None if node is None else self._node(node)
        moment = None if when is None else self._when(when)
        for key in list(self._breakpoints):
            if found in (None, key[0]) and moment in (None, key[1]):
                del self._breakpoints[key]
                self._unhook(key[0])
        self._changed()

    def force(self, node: int | str, result: str) -> None:
        """Force the result of the node's next tick; a running node is halted first.

        Raises BreakpointError for an unknown node or result.
        """
        if not isinstance(result, str) or result not in RESULTS:
            raise BreakpointError(f"a result should be {' or '.join(RESULTS)}, got {result!r}")
        found = self._node(node)
        self._forced[found] = RESULTS[result]
        self._hook(found)

    def _before(self, node: Node) -> int | None:
        self._stop_at(node, "before", node.state == IDLE)
        forced = self._forced.pop(node, None)
        if forced is None:
            return None
        if node.state == RUNNING:
            node.halt_node()
        self._executor.between_ticks(lambda: self._unhook(node))
        return forced

    def _after(self, node: Node, status: int) -> None:
        self._stop_at(node, "after", status in RESULTS.values())

    def _stop_at(self, node: Node, when: When, begins_or_ends: bool) -> None:
        breakpoint = self._breakpoints.get((node, when))
        if breakpoint is None or not breakpoint.met(begins_or_ends):
            return
        if breakpoint.once:
            del self._breakpoints[node, when]
            self._changed()
            self._executor.between_ticks(lambda: self._unhook(node))
        self._executor.hold(PauseReason("breakpoint", node.path, when))

    def _hook(self, node: Node) -> None:
        if node.hooks is None or self._before not in node.hooks.pre:
            node.add_pre_tick(self._before, rebind=False)
            node.add_post_tick(self._after)

    def _unhook(self, node: Node) -> None:
        if not any((node, when) in self._breakpoints for when in ("before", "after")) and node not in self._forced:
            node.remove_hook(self._before, rebind=False)
            node.remove_hook(self._after)

    def _node(self, node: int | str) -> Node:
        tree = self._executor.tree
        if isinstance(node, str):
            named = [known for known in tree.nodes if known.path == node]
            if len(named) > 1:
                numbers = " or ".join(str(one.uid) for one in named)
                raise BreakpointError(f"{len(named)} nodes have the path '{node}'; name one by its number: {numbers}")
            try:
                return tree.node(node)
            except KeyError as error:
                name = node.rpartition("/")[2]
                paths = {known.path: (known.name, known.type_id) for known in tree.nodes}
                like = closest(node, paths) or closest(name, [known.name for known in tree.nodes])
                close = [path for path in paths if name in paths[path]] or [
                    path for path in paths if like and like in (path, paths[path][0])
                ]
                hint = f"; did you mean {' or '.join(repr(path) for path in close[:5])}?" if close else ""
                raise BreakpointError(f"{error.args[0]}{hint}") from error
        if isinstance(node, bool) or not isinstance(node, int) or not 1 <= node <= len(tree.nodes):
            raise BreakpointError(f"a node should be a path or a number from 1 to {len(tree.nodes)}, got {node!r}")
        return tree.nodes[node - 1]

    def _when(self, when: Any) -> When:
        if when not in ("before", "after"):
            raise BreakpointError(f"a breakpoint should be 'before' or 'after' a node, got {when!r}")
        moment: When = when
        return moment
