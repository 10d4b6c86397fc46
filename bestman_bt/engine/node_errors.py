"""Errors of nodes whose tick went wrong: what their authors are told."""

from __future__ import annotations

from typing import TYPE_CHECKING

from py_trees.common import Status as PyTreesStatus

from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.own_files import in_words
from bestman_bt.engine.status import IDLE, STATUS_NAMES

if TYPE_CHECKING:
    from bestman_bt.engine.node import Node


def describe_bad_status(status: object) -> str:
    """Return what to tell the author of a node that returned something odd."""
    if isinstance(status, int) and status == IDLE:
        return "its tick returned IDLE; SUCCESS, FAILURE, RUNNING or SKIPPED are accepted"
    if isinstance(status, PyTreesStatus):
        return f"its tick returned py_trees' {status}; return bestman_bt.engine's {status.name} instead"
    return f"its tick returned {status!r}; one of {', '.join(STATUS_NAMES[1:])} is accepted"


def wrapped(error: Exception, node: Node) -> NodeError:
    """Return a ``NodeError`` that says in which node ``error`` was raised."""
    if type(error).__module__.startswith("bestman_bt.engine"):
        return node.error(str(error) or type(error).__name__)
    return node.error(in_words(error))


def odd_status(status: object, child: Node) -> NodeError:
    """Return the error for a status that no parent accepts."""
    return child.error(describe_bad_status(status))
