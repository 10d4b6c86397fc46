"""Nav2's Cancel… nodes: what a leaf of the same tree does is ended, and that leaf fails."""

from __future__ import annotations

from typing import ClassVar

from behaviours.nav2.ports import SERVER
from behaviours.skill import InstantSkill, Skill
from bestman_bt.engine import RUNNING


class _Cancel(InstantSkill):
    """Cancel what the leaves of a kind wait for, wherever in the tree they run; SUCCESS also where none does."""

    INPUT_PORTS: ClassVar = {**SERVER}
    LEAVES: ClassVar[tuple[str, ...]] = ()

    def act(self) -> None:
        """Cancel."""
        for node in self.owner.nodes:
            if isinstance(node, Skill) and node.state == RUNNING and node.type_id in self.LEAVES:
                node.cancel()
                self.feedback_message = f"{node.path} is cancelled"


class CancelControl(_Cancel):
    """Cancel FollowPath."""

    LEAVES: ClassVar = ("FollowPath",)


class CancelBackUp(_Cancel):
    """Cancel BackUp."""

    LEAVES: ClassVar = ("BackUp",)


class CancelDriveOnHeading(_Cancel):
    """Cancel DriveOnHeading."""

    LEAVES: ClassVar = ("DriveOnHeading",)


class CancelSpin(_Cancel):
    """Cancel Spin."""

    LEAVES: ClassVar = ("Spin",)


class CancelWait(_Cancel):
    """Cancel Wait."""

    LEAVES: ClassVar = ("Wait",)


class CancelAssistedTeleop(_Cancel):
    """Nothing to do: nobody drives by hand through a tree here."""


class CancelComputeAndTrackRoute(_Cancel):
    """Nothing to do: no route is tracked here."""


class CancelFollowObject(_Cancel):
    """Nothing to do: nothing is followed here."""
