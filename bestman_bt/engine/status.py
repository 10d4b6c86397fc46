"""The five statuses of BehaviorTree.CPP as plain integers, and their projection onto py_trees' enum.

They are module constants because reading an enum member costs four times as much on the tick path. ``SKIPPED`` is
returned by a tick and never stored in a node.
"""

from __future__ import annotations

import enum
from typing import Final

from py_trees.common import Status as PyTreesStatus

IDLE: Final = 0
RUNNING: Final = 1
SUCCESS: Final = 2
FAILURE: Final = 3
SKIPPED: Final = 4

STATUS_NAMES: Final = ("IDLE", "RUNNING", "SUCCESS", "FAILURE", "SKIPPED")


class NodeStatus(enum.IntEnum):
    """Type of ``Tree.status`` and of status ports; members equal the constants and print as names."""

    IDLE = IDLE
    RUNNING = RUNNING
    SUCCESS = SUCCESS
    FAILURE = FAILURE
    SKIPPED = SKIPPED

    def __str__(self) -> str:
        return self.name


TO_PY_TREES: Final = {
    IDLE: PyTreesStatus.INVALID,
    RUNNING: PyTreesStatus.RUNNING,
    SUCCESS: PyTreesStatus.SUCCESS,
    FAILURE: PyTreesStatus.FAILURE,
    -SUCCESS: PyTreesStatus.SUCCESS,
    -FAILURE: PyTreesStatus.FAILURE,
}
"""py_trees' status for each internal code; negative codes are idle nodes with their last result."""


def state_code(uid: int, state: int) -> int:
    """Return the entry of ``StateChanges.codes`` for a node and one of its states."""
    return uid * 8 + state


def uid_and_state(code: int) -> tuple[int, int]:
    """Return the uid and state encoded by ``state_code``."""
    return divmod(code, 8)


def from_py_trees(status: PyTreesStatus) -> int:
    """Return the engine's status for a py_trees status (``IDLE`` for ``INVALID``)."""
    if status is PyTreesStatus.SUCCESS:
        return SUCCESS
    if status is PyTreesStatus.FAILURE:
        return FAILURE
    if status is PyTreesStatus.RUNNING:
        return RUNNING
    return IDLE


def status_name(status: int) -> str:
    """Return the name of a status, such as ``"RUNNING"``. Raises ValueError for an unknown status."""
    if 0 <= status < len(STATUS_NAMES):
        return STATUS_NAMES[status]
    raise ValueError(f"status {status} is not one of 0 to {len(STATUS_NAMES) - 1}")
