"""The controls of the page: each request is checked and translated to the control channel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bestman_bt.engine.spelling import closest
from bestman_bt.engine.status import FAILURE, STATUS_NAMES, SUCCESS
from bestman_bt.monitor.run import MonitoredRun, RunError
from bestman_bt.records.events import MAIN_TREE, EventError
from bestman_bt.records.nodes import NodeList

LONGEST_TEXT = 4096
Request = dict[str, Any]


class UnknownControlError(RunError):
    """The control is unknown; the message suggests the closest name, else lists all."""

    def __init__(self, what: str) -> None:
        meant = closest(what, CONTROLS)
        known = f"did you mean {meant!r}?" if meant else f"known: {', '.join(CONTROLS)}"
        super().__init__(f"unknown control {what[:40]!r}; {known}")


def check_fields(what: str, asked: Request) -> None:
    """Check the fields of a request. Raises RunError naming a field that the control does not take."""
    for name in asked:
        if name not in FIELDS.get(what, ()):
            meant = closest(name, FIELDS.get(what, ()))
            known = f"did you mean {meant!r}?" if meant else f"it takes {', '.join(FIELDS.get(what, ())) or 'no field'}"
            raise RunError(f"{what} has no field {name[:40]!r}; {known}")


async def control(run: MonitoredRun, asked: Request) -> Request:
    """Execute one control and return the executor's answer. Raises RunError if the request is invalid or refused."""
    what = asked.get("do")
    if what not in CONTROLS:
        raise UnknownControlError(str(what))
    return await run.request({"do": what, **CONTROLS[what](asked, run.history.nodes)})


def _nothing(asked: Request, nodes: NodeList) -> Request:
    return {}


def _set(asked: Request, nodes: NodeList) -> Request:
    request: Request = {"key": _text(asked, "key")}
    if "value" not in asked:
        raise RunError("set requires a value")
    request["value"] = asked["value"]
    if asked.get("scope"):
        request["scope"] = _text(asked, "scope")
    return request


def _speed(asked: Request, nodes: NodeList) -> Request:
    share = asked.get("share")
    if isinstance(share, bool) or not isinstance(share, int | float):
        raise RunError("speed should be a fraction of full speed, up to 1")
    return {"share": share}


def _breakpoint(asked: Request, nodes: NodeList) -> Request:
    request = _node(asked, nodes) | {"when": _when(asked)}
    if asked.get("condition"):
        request["condition"] = _text(asked, "condition")
    if not isinstance(asked.get("once", False), bool):
        raise RunError("once is true or false")
    return request | {"once": asked.get("once", False)}


def _clear_breakpoint(asked: Request, nodes: NodeList) -> Request:
    """Remove breakpoints: all without ``node``, both of a node without ``when``."""
    request = {} if asked.get("node") is None else _node(asked, nodes)
    return request if asked.get("when") is None else request | {"when": _when(asked)}


def _force(asked: Request, nodes: NodeList) -> Request:
    results = (STATUS_NAMES[SUCCESS], STATUS_NAMES[FAILURE])
    if asked.get("result") not in results:
        raise RunError(f"force requires a result: {' or '.join(results)}")
    return _node(asked, nodes) | {"result": asked["result"]}


CONTROLS: dict[str, Callable[[Request, NodeList], Request]] = {
    "status": _nothing,
    "pause": _nothing,
    "resume": _nothing,
    "step": _nothing,
    "decline": _nothing,
    "speed": _speed,
    "halt": _nothing,
    "stop": _nothing,
    "set": _set,
    "breakpoint": _breakpoint,
    "clear_breakpoint": _clear_breakpoint,
    "force": _force,
}

FIELDS: dict[str, tuple[str, ...]] = {
    "set": ("key", "value", "scope"),
    "speed": ("share",),
    "breakpoint": ("node", "when", "condition", "once"),
    "clear_breakpoint": ("node", "when"),
    "force": ("node", "result"),
}
"""Fields of each control; controls that are not listed have none."""


def _node(asked: Request, nodes: NodeList) -> Request:
    """Return the node; breakpoints and forced results are hooks on nodes of the main tree."""
    uid = asked.get("node")
    if isinstance(uid, str):  # a path, which the executor knows
        return {"node": _text(asked, "node")}
    if not isinstance(uid, int) or isinstance(uid, bool):
        raise RunError("node is the number of a node")
    try:
        tree, inner = nodes.inside(uid)
    except EventError as error:
        raise RunError(str(error)) from error
    if tree != MAIN_TREE:
        raise RunError("only nodes of the main tree can be held or forced, not those of trees loaded while it runs")
    return {"node": inner}


def _when(asked: Request) -> str:
    when = asked.get("when", "before")
    if when not in ("before", "after"):
        raise RunError("when is 'before' or 'after'")
    return str(when)


def _text(asked: Request, field: str) -> str:
    text = asked.get(field)
    if not isinstance(text, str) or not 0 < len(text) <= LONGEST_TEXT:
        raise RunError(f"{field} is a text of 1 to {LONGEST_TEXT} characters")
    return text
