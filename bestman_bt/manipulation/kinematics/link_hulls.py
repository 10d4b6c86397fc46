"""Convex hulls of a robot's links, as points: for views of the robot rather than for collision checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from itertools import product
from types import MappingProxyType

import coal
import numpy as np
import pinocchio
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.manipulation.kinematics.pinocchio_model import build_model, configuration, frame_index, to_pose
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import box_corners
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.urdf_tree import joints_above
from bestman_bt.world_model.world_model import HeldObject


class ForwardKinematics:
    """Forward kinematics of the whole robot; the model is built on first use."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot

    @cached_property
    def _model(self) -> pinocchio.Model:
        return build_model(self.robot)

    @cached_property
    def _data(self) -> pinocchio.Data:
        return self._model.createData()

    def pose(self, frame: str, positions: Mapping[str, float], reference: str | None = None) -> Pose:
        """Return the pose of the link ``frame`` in the link ``reference`` (default: the robot's base frame).

        ``positions``: joint name → radians or metres; missing joints are at zero. Raises ManipulationError for an
        unknown link or joint, or a position that is not finite.
        """
        model, data = self._model, self._data
        frame_id = frame_index(model, frame)
        reference_id = frame_index(model, reference or self.robot.base_frame)
        pinocchio.forwardKinematics(model, data, configuration(model, positions))
        root_from_frame = pinocchio.updateFramePlacement(model, data, frame_id).copy()
        root_from_reference = pinocchio.updateFramePlacement(model, data, reference_id)
        return to_pose(root_from_reference.actInv(root_from_frame))


_TURNS = 16


def link_hulls(robot: RobotModel) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
    """Return link name → convex hulls of its solid shapes, (N, 3) corners each, metres in the link frame."""
    return _hulls(robot.urdf)


@lru_cache(maxsize=4)
def _hulls(urdf: str) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
    """Return the cached hulls of a description; loading the meshes takes a second."""
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
    """Return the bounding rectangle, (2, 2) lower and upper x, y in the base frame, of all links between two heights
    that do not move with ``arm``.

    ``positions``: of all joints, by name, radians. ``low``, ``high``: metres above the floor. None if there is
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
        return box_corners(shape.halfSide)
    if isinstance(shape, coal.Sphere):
        return box_corners(shape.radius)
    turn = np.arange(_TURNS) * 2 * np.pi / _TURNS
    ring = shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(_TURNS, z)]) for z in (-shape.halfLength, shape.halfLength)])


class LinkBodies:
    """All links of a robot; its geometry is loaded on first use."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot

    def at(self, positions: Mapping[str, float]) -> list[NDArray[np.float64]]:
        """Return the corners of the convex hull of each body, (N, 3) metres in the base frame.

        ``positions``: of all joints, by name; missing ones are at zero.
        """
        pose = self._poses(positions)
        return [pose(link).apply(hull) for link, hulls in self._hulls.items() for hull in hulls]

    def _poses(self, positions: Mapping[str, float]) -> Callable[[str], Pose]:
        """Return base_from_frame by the name of the frame."""
        model = self._model
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, configuration(model, positions))
        base_from_root = data.oMf[frame_index(model, self._robot.base_frame)].inverse()
        return lambda frame: to_pose(base_from_root * data.oMf[frame_index(model, frame)])

    @cached_property
    def _model(self) -> pinocchio.Model:
        return build_model(self._robot)

    @cached_property
    def _hulls(self) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
        return link_hulls(self._robot)


class ArmBodies(LinkBodies):
    """Hulls of all links that move with ``arm``, and of the held object."""

    def __init__(self, robot: RobotModel, arm: str = "arm") -> None:
        super().__init__(robot)
        self._arm = robot.of(ArmModel)[arm]

    def at(self, positions: Mapping[str, float], held: HeldObject | None = None) -> list[NDArray[np.float64]]:
        """Return the corners (N, 3) of all moving bodies at ``positions``. ``held``: the object in the hand, as its
        bounding box."""
        bodies = super().at(positions)
        if held is not None:
            low, high = held.model.bounds()
            corners = np.array(list(product(*zip(low, high, strict=True))))
            tool = self._poses(positions)(self._arm.tool_frame)
            bodies.append((tool @ held.tool_from_object).apply(corners))
        return bodies

    @cached_property
    def _hulls(self) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
        moving = set(self._arm.joint_names)
        hulls = link_hulls(self._robot).items()
        return {link: corners for link, corners in hulls if moving & joints_above(self._robot, link)}
