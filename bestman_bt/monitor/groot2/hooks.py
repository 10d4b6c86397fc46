"""Hooks that Groot2 sets on nodes: breakpoints that hold a tick, and results that replace a node.

They follow the ``Groot2Publisher`` of BehaviorTree.CPP: one before and one after each node; a second hook at the same
position changes the first. A breakpoint blocks the thread that ticks: simulated time stops, motions of a robot that
have started continue. A cancelled execution leaves the breakpoint.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from enum import IntEnum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from bestman_bt.engine import FAILURE, SUCCESS, Node, Tree
from bestman_bt.monitor.groot2.protocol import Request, RequestError, RequestKind

POLL = 0.05
"""Seconds between checks of a held tick whether the execution was cancelled."""
NOT_FOUND = "Node ID not found"
_REPLACING = {"SUCCESS": SUCCESS, "FAILURE": FAILURE}
"""The results that replace a node's own; all others have no effect."""


class Position(IntEnum):
    """The position of a hook."""

    BEFORE = 0
    AFTER = 1


class Mode(IntEnum):
    """The action of a hook."""

    BREAKPOINT = 0
    REPLACE = 1


Uid = Annotated[int, Field(ge=0, le=65535)]


class _Message(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    uid: Uid
    position: Position


class _Unlock(_Message):
    desired_status: str
    remove_when_done: bool


class _Insertion(_Message):
    enabled: bool
    mode: Mode
    once: bool
    desired_status: Literal["IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED"]


class _Hook:
    """A hook that stands; guarded by the lock of ``Groot2Hooks``."""

    def __init__(self, asked: _Insertion, run: Callable[[_Hook], int | None]) -> None:
        self.uid, self.position = asked.uid, asked.position
        self.ready = False
        self.change(asked)
        self.callback: Callable[..., int | None] = lambda *_: run(self)

    def change(self, asked: _Insertion) -> None:
        """Adopt the requested settings; the position stays."""
        self.enabled, self.mode, self.once = asked.enabled, asked.mode, asked.once
        self.desired_status: str = asked.desired_status

    def document(self) -> dict[str, Any]:
        return {
            "desired_status": self.desired_status,
            "enabled": self.enabled,
            "mode": int(self.mode),
            "once": self.once,
            "position": int(self.position),
            "uid": self.uid,
        }


class Groot2Hooks:
    """The hooks on the nodes of ``tree``. ``reached``: called, in the ticking thread, with each node whose hook is
    reached. ``replaced``: called there with each result that a hook gave instead of a node, as text.
    """

    def __init__(
        self, tree: Tree, reached: Callable[[int], None], replaced: Callable[[str], None] = lambda what: None
    ) -> None:
        self._tree = tree
        self._reached, self._replaced = reached, replaced
        self._changed = threading.Condition()
        self._hooks: dict[tuple[Position, int], _Hook] = {}

    def answer(self, request: Request) -> bytes | None:
        """Execute a hook request and return the second part of the answer. Raises RequestError for an unknown kind."""
        match request.kind:
            case RequestKind.INSERT_HOOK:
                self.insert(request.needed())
            case RequestKind.REMOVE_HOOK:
                self.remove(request.needed())
            case RequestKind.REMOVE_ALL_HOOKS:
                self.remove_all()
            case RequestKind.DISABLE_ALL_HOOKS:
                self.enable_all(False)
            case RequestKind.DUMP_HOOKS:
                return self.dump()
            case RequestKind.UNLOCK_BREAKPOINT:
                self.unlock(request.needed())
            case _:
                raise RequestError("Request not recognized")
        return None

    def insert(self, content: bytes) -> None:
        """Set or change one hook or a list of hooks; unknown nodes are ignored, as in BehaviorTree.CPP."""
        several = content.lstrip().startswith(b"[")
        for one in _read(list[_Insertion], content) if several else [_read(_Insertion, content)]:
            with self._changed:
                standing = self._hooks.get((one.position, one.uid))
                if standing is not None:
                    standing.ready |= standing.mode is Mode.BREAKPOINT and one.mode is Mode.REPLACE
                    standing.change(one)
                    self._changed.notify_all()
                elif 1 <= one.uid <= len(self._tree.nodes):
                    self._put(_Hook(one, self._run))

    def remove(self, content: bytes) -> None:
        """Remove one hook and release the tick that it holds."""
        asked = _read(_Message, content)
        with self._changed:
            self._take(self._standing(asked))

    def remove_all(self) -> None:
        """Remove all hooks and release the ticks that they hold."""
        with self._changed:
            for hook in list(self._hooks.values()):
                self._take(hook)

    def enable_all(self, enabled: bool) -> None:
        """Enable all hooks, or disable them so that they have no effect."""
        with self._changed:
            for hook in self._hooks.values():
                hook.enabled = enabled
            self._changed.notify_all()

    def unlock(self, content: bytes) -> None:
        """Release the tick that a breakpoint holds, with the given result for the node, if any."""
        asked = _read(_Unlock, content)
        with self._changed:
            hook = self._standing(asked)
            hook.desired_status = asked.desired_status if asked.desired_status in _REPLACING else "SKIPPED"
            hook.once |= asked.remove_when_done
            hook.ready |= hook.mode is Mode.BREAKPOINT
            self._changed.notify_all()

    def dump(self) -> bytes:
        """Return all hooks as JSON, pre-tick hooks first."""
        with self._changed:
            standing = sorted(self._hooks.values(), key=lambda hook: (hook.position, hook.uid))
            return json.dumps([hook.document() for hook in standing], separators=(",", ":")).encode()

    def _standing(self, asked: _Message) -> _Hook:
        hook = self._hooks.get((asked.position, asked.uid))
        if hook is None:
            raise RequestError(NOT_FOUND)
        return hook

    def _put(self, hook: _Hook) -> None:
        self._hooks[hook.position, hook.uid] = hook
        node = self._node(hook)
        if hook.position is Position.BEFORE:
            node.add_pre_tick(hook.callback)
        else:
            node.add_post_tick(hook.callback)

    def _take(self, hook: _Hook) -> None:
        hook.enabled = False  # a tick may already have read the callback
        if self._hooks.pop((hook.position, hook.uid), None) is hook:
            self._node(hook).remove_hook(hook.callback)
        self._changed.notify_all()

    def _node(self, hook: _Hook) -> Node:
        return self._tree.nodes[hook.uid - 1]

    def _run(self, hook: _Hook) -> int | None:
        """Notify subscribers that the tick has come to ``hook``, wait at a breakpoint, and return the replacement of
        the result.
        """
        if not hook.enabled:
            return None
        if hook.mode is Mode.BREAKPOINT:
            self._tree.publish()
        self._reached(hook.uid)
        with self._changed:
            if hook.mode is Mode.BREAKPOINT:
                while hook.enabled and not hook.ready:
                    self._changed.wait(POLL)
                    self._tree.raise_if_refused()
                hook.ready = False
            if not hook.enabled:
                return None
            if hook.once:
                self._take(hook)
            instead = _REPLACING.get(hook.desired_status)
        if instead is not None:
            self._replaced(f"{self._node(hook).path} was forced to return {hook.desired_status}")
        return instead


def _read(form: Any, content: bytes) -> Any:
    try:
        return TypeAdapter(form).validate_json(content, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise RequestError(f"{place + ': ' if place else ''}{first['msg']}") from error
