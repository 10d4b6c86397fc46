"""Optional wrappers around a node's tick: scripts of conditions, callbacks, py_trees' visits."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS

if TYPE_CHECKING:
    from bestman_bt.engine.core.node import Node


Tick = Callable[[], int]
PreTick = Callable[["Node"], "int | None"]
PostTick = Callable[["Node", int], "int | None"]

_INSTEAD = {"_skipIf": SKIPPED, "_failureIf": FAILURE, "_successIf": SUCCESS}
"""Scripts that replace the tick if they are true."""


class Conditions:
    """The compiled scripts around one node's tick: ``_skipIf`` and the like before, ``_onSuccess`` after."""

    __slots__ = ("on_failure", "on_halted", "on_success", "post", "pre")

    def __init__(self) -> None:
        self.pre: list[tuple[str, Callable[[], bool]]] = []
        self.on_success: Callable[[], Any] | None = None
        self.on_failure: Callable[[], Any] | None = None
        self.on_halted: Callable[[], Any] | None = None
        self.post: Callable[[], Any] | None = None

    @property
    def after(self) -> bool:
        """Whether a script follows the tick."""
        return not (self.on_success is None and self.on_failure is None and self.post is None)


class Hooks:
    """The callbacks around one node's tick; a status that they return replaces that of the tick."""

    __slots__ = ("monitor", "post", "pre")

    def __init__(self) -> None:
        self.pre: list[PreTick] = []
        self.post: list[PostTick] = []
        self.monitor: list[PostTick] = []


def with_visits(node: Node, core: Tick, visited: list[Node]) -> Tick:
    """Return the tick with every visit appended to ``visited``."""

    def run() -> int:
        status = core()
        visited.append(node)
        return status

    return run


def with_pre_hooks(node: Node, core: Tick, hooks: Hooks) -> Tick:
    """Return the tick with the callbacks before it and the monitors after it."""

    def run() -> int:
        if node._s <= RUNNING:
            for before in tuple(hooks.pre):  # one may remove itself
                replaced = before(node)
                if replaced in (SUCCESS, FAILURE, SKIPPED):
                    return int(replaced)
        status = core()
        for watch in hooks.monitor:
            watch(node, status)
        return status

    return run


def with_post_hooks(node: Node, core: Tick, hooks: Hooks) -> Tick:
    """Return the tick with the callbacks after it."""

    def run() -> int:
        status = core()
        for after in tuple(hooks.post):
            replaced = after(node, status)
            if replaced in (SUCCESS, FAILURE):
                status = int(replaced)
        return status

    return run


def with_conditions(node: Node, core: Tick, conditions: Conditions) -> Tick:
    """Return the tick with the scripts before and after it; a single ``_skipIf``, the common case, costs one call."""
    pre = conditions.pre
    if len(pre) == 1 and pre[0][0] == "_skipIf" and not conditions.after:
        skips = pre[0][1]

        def run_unless_skipped() -> int:
            if node._s <= 0 and skips():
                return SKIPPED
            return core()

        return run_unless_skipped

    def run() -> int:
        status = _instead(node, pre) if pre else -1
        if status < 0:
            status = core()
        if status == SUCCESS:
            _run_scripts(conditions.on_success, conditions.post)
        elif status == FAILURE:
            _run_scripts(conditions.on_failure, conditions.post)
        return status

    return run


def _run_scripts(*scripts: Callable[[], Any] | None) -> None:
    for script in scripts:
        if script is not None:
            script()


def _instead(node: Node, pre: list[tuple[str, Callable[[], bool]]]) -> int:
    """Return the status that a script gives in the tick's place, or -1."""
    code = node._s
    if code <= 0:
        return _before_start(pre)
    kind, holds = pre[-1]
    if code == RUNNING and kind == "_while" and not holds():
        node.halt_node()
        return SKIPPED
    return -1


def _before_start(pre: list[tuple[str, Callable[[], bool]]]) -> int:
    for kind, holds in pre:
        if holds():
            if kind != "_while":
                return _INSTEAD[kind]
        elif kind == "_while":
            return SKIPPED
    return -1
