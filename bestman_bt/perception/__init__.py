"""Perception: from RGB-D images to surfaces, objects with poses, and grasps; arrays and messages in, never a robot."""

from bestman_bt.perception.errors import NoSurfaceError, PerceptionError
from bestman_bt.perception.view import View

__all__ = ["NoSurfaceError", "PerceptionError", "View"]
