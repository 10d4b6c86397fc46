"""Nav2's Cancel… nodes: end the motion of a leaf of the same tree, which then fails."""

from __future__ import annotations

from typing import ClassVar

from behaviours.nav2.ports import SERVER
from behaviours.skill import InstantSkill, Skill
from bestman_bt.engine import RUNNING


class _Cancel(InstantSkill):
    """Cancel the motions of all running leaves of a kind in the tree; SUCCESS also if there are none."""

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
    """Do nothing: teleoperation is not supported."""


class CancelComputeAndTrackRoute(_Cancel):
    """Do nothing: route tracking is not supported."""


class CancelFollowObject(_Cancel):
    """Do nothing: following objects is not supported."""
