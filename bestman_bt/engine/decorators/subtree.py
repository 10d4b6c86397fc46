"""SubTree: another tree as a node, with its own blackboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from py_trees.behaviour import Behaviour

from bestman_bt.engine.core.node import Node, invalid_status_error, wrapped
from bestman_bt.engine.core.ports import In
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS

if TYPE_CHECKING:
    from bestman_bt.engine.core.tree import Tree


def mapping_tick_bare(on_success: int, on_failure: int, *, keeps: bool = False) -> Callable[[Any], int]:
    """Return the tick function of a decorator that maps its child's result, without listeners.

    With ``keeps``, the node's previous result survives a skipped child unless it has been reset.
    """

    def tick(self: Any) -> int:
        code = self._s
        self._s = RUNNING
        run, child = self.only
        try:
            status = run()
        except NodeError:
            if keeps and code > RUNNING:
                self._s = code
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, child) from error
        if status == RUNNING:
            if child._s != RUNNING:
                child.begin_running()
            return RUNNING
        if status == SUCCESS or status == FAILURE:
            child._s = -status
            return on_success if status == SUCCESS else on_failure
        if status == SKIPPED:
            if keeps and code > RUNNING:
                self._s = code
            return SKIPPED
        raise invalid_status_error(status, child)

    return tick


def mapping_tick_traced(on_success: int, on_failure: int) -> Callable[[Any], int]:
    """Return the same tick, logging every state change."""

    def tick(self: Any) -> int:
        log = self.log
        if self._s != RUNNING:
            self._s = RUNNING
            log.append(self.ev[1])
        run, child = self.only
        try:
            status = run()
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, child) from error
        if status == RUNNING:
            if child._s != RUNNING:
                child.begin_running()
                log.append(child.ev[1])
            return RUNNING
        if status == SUCCESS or status == FAILURE:
            events = child.ev
            if child._s != status:
                log.append(events[status])
            log.append(events[0])
            child._s = -status
            return on_success if status == SUCCESS else on_failure
        if status == SKIPPED:
            return SKIPPED
        raise invalid_status_error(status, child)

    return tick


class Inverter(Decorator):
    """Swaps SUCCESS and FAILURE of its child."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(FAILURE, SUCCESS)
    tick_traced = mapping_tick_traced(FAILURE, SUCCESS)


class ForceSuccess(Decorator):
    """Returns SUCCESS for any result of its child."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(SUCCESS, SUCCESS)
    tick_traced = mapping_tick_traced(SUCCESS, SUCCESS)


class ForceFailure(Decorator):
    """Returns FAILURE for any result of its child."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(FAILURE, FAILURE)
    tick_traced = mapping_tick_traced(FAILURE, FAILURE)


_traced = mapping_tick_traced(SUCCESS, FAILURE)


def _tick_traced(self: Any) -> int:
    code = self._s
    if code <= 1:
        return _traced(self)
    self._s = 1  # one that still holds SUCCESS or FAILURE is not set RUNNING again
    try:
        return _traced(self)
    finally:
        self._s = code


class SubTree(Decorator):
    """Runs another tree. Its attributes map the subtree's keys: ``key="{outer}"``, ``key="literal"``.

    In Python: ``SubTree(build_pick, target="{cup}")`` with a function that returns the subtree's root, or
    ``SubTree(root, target="{cup}")``. A function is called once per instance. A ``Path`` to an XML file, or a tree
    loaded from XML, is read when the enclosing tree is built; ``loaded`` holds it.
    """

    KIND: ClassVar[str] = "SubTree"
    autoremap = In(bool, "If true, all the ports with the same name will be remapped", default=False, port="_autoremap")
    RESETS_CHILD = True
    tree_id: str = ""
    subtree_path: str = ""
    loaded: Tree | Path | None = None
    tick_bare = mapping_tick_bare(SUCCESS, FAILURE, keeps=True)
    tick_traced = _tick_traced

    def __init__(
        self,
        tree: Callable[[], Node] | Behaviour | Tree | Path,
        *args: Any,
        name: str | None = None,
        tree_id: str | None = None,
        **attributes: Any,
    ) -> None:
        children: list[Behaviour] = []
        if isinstance(tree, Behaviour):
            children, found = [tree], tree.name
        elif isinstance(tree, Path):
            self.loaded, found = tree, tree.stem
        elif callable(tree):
            children, found = [tree()], getattr(tree, "__name__", "tree")
        elif hasattr(tree, "tree_id"):
            self.loaded, found = tree, tree.tree_id
        else:
            raise TypeError(
                f"SubTree takes a node, a function that returns one, a loaded tree or a Path but got {tree!r}"
            )
        self.tree_id = tree_id or found
        self.named = name is not None or bool(args)
        super().__init__(*args, children, name=name if name is not None or args else self.tree_id, **attributes)

    @property
    def type_id(self) -> str:
        """The ID of the tree that the node runs."""
        return self.tree_id
