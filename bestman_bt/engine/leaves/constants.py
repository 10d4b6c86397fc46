"""AlwaysSuccess and AlwaysFailure."""

from __future__ import annotations

from bestman_bt.engine.leaves.base import SyncAction
from bestman_bt.engine.status import FAILURE, SUCCESS


class AlwaysSuccess(SyncAction):
    """SUCCESS at every tick."""

    def on_tick(self) -> int:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(SyncAction):
    """FAILURE at every tick."""

    def on_tick(self) -> int:
        """Fail."""
        return FAILURE
