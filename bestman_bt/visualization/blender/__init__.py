"""Pictures by Blender (Cycles): a job is written down, and a Blender of its own, in a process of its own, paints it."""

from bestman_bt.visualization.blender.painting import (
    BlenderError,
    Finish,
    PaintedBody,
    PaintedFrame,
    PaintedRobot,
    PaintJob,
    blender_python,
    install_blender,
    paint,
)

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
