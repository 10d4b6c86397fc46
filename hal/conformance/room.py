"""Where simulated robots are put to the test."""

from __future__ import annotations

from bestman_bt.messages import Pose2D
from bestman_bt.scene.scene import Wall, World


def empty_room() -> World:
    """Return a world with four walls, 3 m away from the robot."""
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
    walls = tuple(Wall(a, b, 1.2, 0.1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    return World("empty", 0, walls, (), (), Pose2D(0.0, 0.0, 0.0), {})
