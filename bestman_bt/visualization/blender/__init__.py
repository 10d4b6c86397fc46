"""Pictures by Blender (Cycles): a job is written down, and a Blender of its own, in a process of its own, paints it."""

from bestman_bt.visualization.blender.installation import BlenderError, blender_python, install_blender
from bestman_bt.visualization.blender.job import Finish, PaintedBody, PaintedFrame, PaintJob
from bestman_bt.visualization.blender.painted_robot import PaintedRobot
from bestman_bt.visualization.blender.painting import paint

__all__ = [
    "BlenderError",
    "Finish",
    "PaintJob",
    "PaintedBody",
    "PaintedFrame",
    "PaintedRobot",
    "blender_python",
    "install_blender",
    "paint",
]
