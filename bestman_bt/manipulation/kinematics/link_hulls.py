"""Convex hulls of a robot's links, as points: for looking at the robot rather than for collision checks."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.manipulation.kinematics.pinocchio_model import build_model
from bestman_bt.robot_model import RobotModel

_TURNS = 16


def link_hulls(robot: RobotModel) -> dict[str, tuple[NDArray[np.float64], ...]]:
    """Link name → for each of its solid shapes the corners of a convex hull, (N, 3) metres in the link's frame."""
    model = build_model(robot)
    geometry = pinocchio.buildGeomFromUrdfString(model, robot.urdf, pinocchio.GeometryType.COLLISION)
    hulls: dict[str, list[NDArray[np.float64]]] = {}
    for body in geometry.geometryObjects:
        frame = model.frames[body.parentFrame]
        link_from_body = frame.placement.actInv(body.placement)
        corners = _corners(body.geometry) * np.asarray(body.meshScale)
        points = corners @ link_from_body.rotation.T + link_from_body.translation
        hulls.setdefault(frame.name, []).append(points)
    return {link: tuple(points) for link, points in hulls.items()}


def _corners(shape: coal.CollisionGeometry) -> NDArray[np.float64]:
    if isinstance(shape, coal.BVHModelBase):
        vertices = np.asarray(shape.vertices())
        hull: NDArray[np.float64] = vertices[ConvexHull(vertices).vertices]
        return hull
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide)
    elif isinstance(shape, coal.Sphere):
        half = np.full(3, shape.radius)
    else:
        turn = np.arange(_TURNS) * 2 * np.pi / _TURNS
        ring = shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
        ends = (-shape.halfLength, shape.halfLength)
        return np.vstack([np.column_stack([ring, np.full(_TURNS, z)]) for z in ends])
    corners: NDArray[np.float64] = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    return corners
