"""Convex hulls of a robot's links, as points: for looking at the robot rather than for collision checks."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

import coal
import numpy as np
import pinocchio
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.manipulation.kinematics.forward import ForwardKinematics
from bestman_bt.robot_model import ArmModel, RobotModel

_TURNS = 16


def link_hulls(robot: RobotModel) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
    """Link name → for each of its solid shapes the corners of a convex hull, (N, 3) metres in the link's frame."""
    return _hulls(robot.urdf)


@lru_cache(maxsize=4)
def _hulls(urdf: str) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
    """By description, as loading the meshes takes a second."""
    model = pinocchio.buildModelFromXML(urdf)
    geometry = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    hulls: dict[str, list[NDArray[np.float64]]] = {}
    for body in geometry.geometryObjects:
        frame = model.frames[body.parentFrame]
        link_from_body = frame.placement.actInv(body.placement)
        # The vertices of a mesh have its scale already.
        points = _corners(body.geometry) @ link_from_body.rotation.T + link_from_body.translation
        hulls.setdefault(frame.name, []).append(points)
    return MappingProxyType({link: tuple(points) for link, points in hulls.items()})


def body_between(
    robot: RobotModel, positions: Mapping[str, float], arm: str, low: float, high: float
) -> NDArray[np.float64] | None:
    """Lower and upper corner (2, 2) x, y in the base frame of all between two heights that does not move with ``arm``.

    ``positions``: of all joints, by name, radians. ``low``, ``high``: metres above the floor. None where there is
    nothing.
    """
    forward = ForwardKinematics(robot)
    swung = {**positions, **{name: positions[name] + 0.1 for name in robot.of(ArmModel)[arm].joint_names}}
    corners = []
    for link, hulls in link_hulls(robot).items():
        pose = forward.pose(link, positions)
        if not np.allclose(pose.position, forward.pose(link, swung).position, atol=1e-6):
            continue
        for hull in hulls:
            points = pose.apply(hull)
            if points[:, 2].max() > low and points[:, 2].min() < high:
                corners += [points[:, :2].min(axis=0), points[:, :2].max(axis=0)]
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)]) if corners else None


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
