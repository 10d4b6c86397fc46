"""How a handle moves when its door or drawer opens: along a line, or on an arc about the hinge."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Handle, Pose


def handle_motion(handle: Handle, distance: float) -> Pose:
    """The rigid motion that carries the handle ``distance`` metres along its way, in the frame of ``handle``.

    ``handle_motion(handle, d) @ pose`` is where what was at ``pose`` on the moving part is then. An arc where joint and
    hinge are known, else the line in which the handle starts to move.
    """
    if handle.joint == "revolute" and handle.hinge is not None and handle.hinge_direction is not None:
        axis = handle.hinge_direction
        arm = handle.pose.position - handle.hinge
        way = np.cross(axis, arm)
        radius = float(np.linalg.norm(way))
        if radius > 1e-3:
            angle = distance / radius * (1.0 if float(way @ handle.opening_direction) >= 0.0 else -1.0)
            turn = Pose(np.zeros(3), np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)))
            return Pose(handle.hinge) @ turn @ Pose(-handle.hinge)
    return Pose(distance * handle.opening_direction)
