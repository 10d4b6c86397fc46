"""Collision worlds by pinocchio and coal: convex hulls of the links, broad phase by a dynamic tree of boxes.

Pan et al., "FCL: a general purpose library for collision and proximity queries", ICRA 2012 (coal is its successor).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from typing import TypeAlias

import coal
import numpy as np
import pinocchio
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.manipulation.collision.base import CollisionModel, CollisionWorld
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, VoxelObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import joint_vector
from bestman_bt.manipulation.kinematics.pinocchio_model import (
    arm_order,
    build_model,
    configuration,
    frame_index,
    joints_to_lock,
    to_se3,
)
from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Shape, Sphere
from bestman_bt.messages.shapes import box_corners
from bestman_bt.robot_model.model import ArmModel, RobotModel

# Voxels for coal: an octree, and which voxels the robot itself disproves.
# Hornung et al., "OctoMap: an efficient probabilistic 3D mapping framework based on octrees", Autonomous Robots 2013.


Placed: TypeAlias = tuple[coal.CollisionGeometry, pinocchio.SE3]
"""A geometry and its pose in the frame of its body."""


def octree(voxels: VoxelObstacle) -> coal.OcTree:
    """Return the octree of occupied voxels, in the frame of their grid."""
    return coal.makeOctree((voxels.indices + 0.5) * voxels.resolution, voxels.resolution)


def clear_of(voxels: VoxelObstacle, bodies: Sequence[Placed], margin: float) -> VoxelObstacle:
    """Return the voxels that do not touch the bounding box of any body, grown by ``margin`` metres.

    The robot's own current volume is thus free. ``bodies``: geometries and their poses in the base frame.
    """
    reach = margin + math.sqrt(3.0) / 2 * voxels.resolution
    indices = voxels.indices
    centres = voxels.base_from_grid.apply((indices + 0.5) * voxels.resolution)
    for geometry, base_from_body in bodies:
        geometry.computeLocalAABB()
        box = geometry.aabb_local
        local = (centres - base_from_body.translation) @ base_from_body.rotation
        outside = ((local < box.min_ - reach) | (local > box.max_ + reach)).any(axis=1)
        indices, centres = indices[outside], centres[outside]
    return replace(voxels, indices=np.ascontiguousarray(indices))


def fingerprint(value: object) -> str:
    """Return 32 hexadecimal digits for a value of dataclasses, mappings, sets, sequences, arrays, texts and numbers.

    Raises TypeError for other types.
    """
    return hashlib.blake2b(_encoded(value), digest_size=16).hexdigest()


def _encoded(value: object) -> bytes:
    """Return a description in which the type and the length of every part come before it, so that no two values share
    one.
    """
    match value:
        case np.ndarray():
            content = f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
        case None | str() | bool() | int() | float() | np.generic():
            content = repr(value).encode()
        case Mapping():
            content = b"".join(sorted(_encoded(item) for item in value.items()))
        case frozenset() | set():
            content = b"".join(sorted(_encoded(item) for item in value))
        case tuple() | list():
            content = b"".join(_encoded(item) for item in value)
        case _ if is_dataclass(value):
            content = b"".join(_encoded((field.name, getattr(value, field.name))) for field in fields(value))
        case _:
            raise TypeError(f"no fingerprint for a {type(value).__name__}")
    return f"{type(value).__name__}:{len(content)}:".encode() + content


# At a margin of exactly zero, coal's GJK was seen to miss an overlap of 9 mm (link 5 and hand of a Panda); any
# positive margin made it certain.
_SMALLEST_MARGIN = 1e-5
_FEW_BODIES = 150


class CoalCollisionModel(CollisionModel):
    """The robot's geometry with convex meshes, loaded with the first world; afterwards a world takes about 2 ms."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot

    @cached_property
    def _model(self) -> pinocchio.Model:
        return build_model(self.robot)

    @cached_property
    def geometry(self) -> pinocchio.GeometryModel:
        """The shapes of the robot's links; meshes are replaced by their convex hulls."""
        geometry = pinocchio.buildGeomFromUrdfString(self._model, self.robot.urdf, pinocchio.GeometryType.COLLISION)
        for body in geometry.geometryObjects:
            if isinstance(body.geometry, coal.BVHModelBase):
                body.geometry = _convex(body.geometry)
        return geometry

    @override
    def world(self, scene: PlanningScene, arm: str = "arm") -> CoalCollisionWorld:
        if arm not in self.robot.of(ArmModel):
            known = ", ".join(self.robot.of(ArmModel)) or "none"
            raise ManipulationError(f"robot {self.robot.name!r} has no arm {arm!r}; it has {known}")
        arm_model = self.robot.of(ArmModel)[arm]
        if scene.voxels:
            scene = self._disproved(scene)
        lock = joints_to_lock(self._model, arm_model)
        reduced, geometry = pinocchio.buildReducedModel(
            self._model, self.geometry, lock, configuration(self._model, scene.positions)
        )
        others = frozenset().union(*(links for name, links in self._arm_links.items() if name != arm))
        return CoalCollisionWorld(reduced, geometry, arm_model, self.robot, scene, others)

    @cached_property
    def _arm_links(self) -> dict[str, frozenset[str]]:
        """Arm → the links with geometry that it moves, those of its hand among them."""
        model, links = self._model, {}
        for name, arm in self.robot.of(ArmModel).items():
            joints = set(model.subtrees[model.getJointId(arm.joint_names[0])])
            bodies = (body for body in self.geometry.geometryObjects if body.parentJoint in joints)
            links[name] = frozenset(model.frames[body.parentFrame].name for body in bodies)
        return links

    def _disproved(self, scene: PlanningScene) -> PlanningScene:
        """Return the scene without the voxels where the robot, or what it holds, is now."""
        model, geometry = self._model, self.geometry
        data, geometry_data = model.createData(), pinocchio.GeometryData(geometry)
        pinocchio.updateGeometryPlacements(model, data, geometry, geometry_data, configuration(model, scene.positions))
        pinocchio.updateFramePlacements(model, data)
        base_from_root = data.oMf[frame_index(model, self.robot.base_frame)].inverse()
        bodies = [
            (body.geometry, base_from_root * placement)
            for body, placement in zip(geometry.geometryObjects, geometry_data.oMg, strict=True)
        ]
        for held in (*scene.carried, *((scene.attached,) if scene.attached is not None else ())):
            tool = base_from_root * data.oMf[frame_index(model, held.tool_frame)] * to_se3(held.tool_from_object)
            bodies += [(shape, tool * pose) for shape, pose in _placed(held.shapes, held.name)]
        return replace(scene, voxels=tuple(clear_of(voxels, bodies, scene.padding) for voxels in scene.voxels))


class CoalCollisionWorld(CollisionWorld):
    """One arm among the obstacles of a scene; created by ``CoalCollisionModel.world``."""

    def __init__(
        self,
        model: pinocchio.Model,
        geometry: pinocchio.GeometryModel,
        arm: ArmModel,
        robot: RobotModel,
        scene: PlanningScene,
        links_of_other_arms: frozenset[str],
    ) -> None:
        self._arm = arm
        self._links_of_other_arms = links_of_other_arms
        self._robot = robot
        self._scene = scene
        self._model = model
        self._data = model.createData()
        self._shape = (len(arm.joint_names),)
        self._order = arm_order(model, arm)
        self._geometry = geometry
        self._owners: list[str] = [model.frames[body.parentFrame].name for body in geometry.geometryObjects]
        self._links = len(self._owners)
        self._pairs: dict[tuple[int, int], float] = {}
        self._pair_up_links(robot, scene)
        self._add_obstacles(robot, scene, range(len(self._owners)))
        self._geometry_data = self._check_pairs()
        self._broad_phase = _broad_phase(model, geometry, self._geometry_data)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the arm's joints."""
        return self._arm.joint_names

    @cached_property
    def fingerprint(self) -> str:
        """A hash of the robot, the arm and the scene."""
        return fingerprint((self._robot.urdf, self._robot.allowed_self_pairs, self._arm.joint_names, self._scene))

    def is_free(self, positions: ArrayLike) -> bool:
        """Return whether nothing is nearer than its padding at ``positions`` (n,), radians."""
        q = self._configuration(positions)
        return not pinocchio.computeCollisions(self._model, self._data, self._broad_phase, q, True)

    def colliding_pairs(self, positions: ArrayLike) -> tuple[tuple[str, str], ...]:
        """Return the sorted pairs of names that are nearer than their padding at ``positions`` (n,)."""
        q = self._configuration(positions)
        pinocchio.computeCollisions(self._model, self._data, self._geometry, self._geometry_data, q, False)
        touching = {
            tuple(sorted((self._owners[pair.first], self._owners[pair.second])))
            for pair, result in zip(self._geometry.collisionPairs, self._geometry_data.collisionResults, strict=True)
            if result.isCollision()
        }
        return tuple(sorted((a, b) for a, b in touching))

    def distance(self, positions: ArrayLike) -> float:
        """Return the smallest distance of any checked pair at ``positions`` (n,), metres; negative if bodies
        overlap."""
        q = self._configuration(positions)
        pinocchio.computeDistances(self._model, self._data, self._geometry, self._geometry_data, q)
        return min((result.min_distance for result in self._geometry_data.distanceResults), default=math.inf)

    def clearance(self, positions: ArrayLike) -> float:
        """Return the smallest distance beyond a pair's padding at ``positions`` (n,), metres."""
        return min((clearance for clearance, _, _ in self._clearances(positions)), default=math.inf)

    def nearest_pair(self, positions: ArrayLike) -> tuple[str, str] | None:
        """Return the link or held object and the obstacle that are nearest to contact at ``positions`` (n,), or
        None.
        """
        others = [near for near in self._clearances(positions) if near[2] >= self._links]
        if not others:
            return None
        _, first, second = min(others)
        one, other = sorted((self._owners[first], self._owners[second]))
        return one, other

    def bodies(self, positions: ArrayLike) -> list[tuple[str, NDArray[np.float64]]]:
        """Name and corners (N, 3) of each convex body at ``positions`` (n,), in the base frame."""
        model, data = self._model, self._data
        pinocchio.updateGeometryPlacements(
            model, data, self._geometry, self._geometry_data, self._configuration(positions)
        )
        pinocchio.updateFramePlacements(model, data)
        base = data.oMf[frame_index(model, self._robot.base_frame)]
        placed = zip(self._owners, self._geometry.geometryObjects, self._geometry_data.oMg, strict=True)
        return [
            (name, corners @ (at := base.actInv(pose)).rotation.T + at.translation)
            for name, body, pose in placed
            if (corners := _corners(body.geometry)) is not None
        ]

    def _clearances(self, positions: ArrayLike) -> list[tuple[float, int, int]]:
        """Return the clearances, metres beyond their padding, and the two bodies of each pair."""
        q = self._configuration(positions)
        fresh = pinocchio.GeometryData(self._geometry)  # else the last digits depend on what was asked before
        pinocchio.computeDistances(self._model, self._data, self._geometry, fresh, q)
        return [
            (result.min_distance - self._pairs[pair.first, pair.second], pair.first, pair.second)
            for result, pair in zip(fresh.distanceResults, self._geometry.collisionPairs, strict=True)
        ]

    def _configuration(self, positions: ArrayLike) -> NDArray[np.float64]:
        q = np.asarray(positions, dtype=float)
        if q.shape != self._shape or not math.isfinite(q.dot(q)):
            q = joint_vector(q, self._shape[0], "positions of a collision check")
        return q if self._order is None else q[self._order]

    def _pair_up_links(self, robot: RobotModel, scene: PlanningScene) -> None:
        allowed = robot.allowed_self_pairs | scene.allowed_pairs
        bodies = list(self._geometry.geometryObjects)
        for i, first in enumerate(bodies):
            for j in range(i + 1, len(bodies)):
                moves = first.parentJoint != bodies[j].parentJoint
                pair = frozenset((self._owners[i], self._owners[j]))
                if moves and pair not in allowed:
                    apart = scene.other_arm_padding if pair & self._links_of_other_arms else 0.0
                    self._pair(i, j, max(scene.self_padding, apart))

    def _add_obstacles(self, robot: RobotModel, scene: PlanningScene, links: Sequence[int]) -> None:
        model, allowed = self._model, scene.allowed_pairs
        base = model.frames[frame_index(model, robot.base_frame)]
        moving = [i for i in links if self._geometry.geometryObjects[i].parentJoint != base.parentJoint]
        held: list[int] = []
        taken = set(self._owners)
        apart = scene.other_arm_padding if len(robot.arm_names) > 1 else 0.0
        if scene.attached is not None:
            attached = scene.attached
            tool = model.frames[frame_index(model, attached.tool_frame)]
            joint_from_object = tool.placement * to_se3(attached.tool_from_object)
            held = self._add_bodies(
                attached.name, _placed(attached.shapes, attached.name), tool.parentJoint, joint_from_object, taken
            )
            for i in links:
                touch = (
                    self._owners[i] in attached.touch_links or frozenset((attached.name, self._owners[i])) in allowed
                )
                if not touch and self._geometry.geometryObjects[i].parentJoint != tool.parentJoint:
                    kept = scene.self_padding if i in moving else max(scene.self_padding, apart)
                    for j in held:
                        self._pair(i, j, kept + attached.padding)
        surroundings = [(o.name, _placed(o.shapes, o.name), o.padding) for o in scene.obstacles]
        surroundings += [
            (v.name, [(octree(v), to_se3(v.base_from_grid))], v.padding) for v in scene.voxels if len(v.indices)
        ]
        for other in scene.carried:
            base_from_tool = base.placement.actInv(model.frames[frame_index(model, other.tool_frame)].placement)
            base_from_object = base_from_tool * to_se3(other.tool_from_object)
            placed = [(shape, base_from_object * pose) for shape, pose in _placed(other.shapes, other.name)]
            surroundings.append((other.name, placed, max(other.padding, apart - scene.padding)))
        for name, placed, padding in surroundings:
            bodies = self._add_bodies(name, placed, base.parentJoint, base.placement, taken)
            margin = scene.padding + padding
            for i in moving + held:
                if frozenset((name, self._owners[i])) in allowed:
                    continue
                extra = scene.attached.padding if scene.attached is not None and i in held else 0.0
                for j in bodies:
                    self._pair(i, j, margin + extra)

    def _add_bodies(
        self,
        name: str,
        placed: Sequence[Placed],
        joint: int,
        joint_from_body: pinocchio.SE3,
        taken: set[str],
    ) -> list[int]:
        if name in taken:
            raise ManipulationError(f"the planning scene has two bodies named {name!r}; names should differ")
        taken.add(name)
        indices = []
        for k, (geometry, pose) in enumerate(placed):
            body = pinocchio.GeometryObject(f"{name}#{k}", joint, joint_from_body * pose, geometry)
            indices.append(self._geometry.addGeometryObject(body))
            self._owners.append(name)
        return indices

    def _pair(self, i: int, j: int, margin: float) -> None:
        self._pairs[min(i, j), max(i, j)] = max(margin, _SMALLEST_MARGIN)

    def _check_pairs(self) -> pinocchio.GeometryData:
        """Pass all pairs to the geometry in one call: one by one they would take half of the time to build a world."""
        count = len(self._owners)
        margins = np.zeros((count, count))
        if self._pairs:
            margins[tuple(np.array(list(self._pairs)).T)] = list(self._pairs.values())
        self._geometry.setCollisionPairs(margins > 0.0)
        data = pinocchio.GeometryData(self._geometry)
        data.setSecurityMargins(self._geometry, margins, True, False)
        return data


def _broad_phase(
    model: pinocchio.Model, geometry: pinocchio.GeometryModel, data: pinocchio.GeometryData
) -> pinocchio.BroadPhaseManagerBase:
    """Return the broad phase: few boxes are compared fastest all with all; a tree costs twice as much until there are
    many.
    """
    few = len(geometry.geometryObjects) <= _FEW_BODIES
    manager = "NaiveCollisionManager" if few else "DynamicAABBTreeCollisionManager"
    return getattr(pinocchio, f"BroadPhaseManager_{manager}")(model, geometry, data)


def _placed(shapes: Sequence[PlacedShape], name: str) -> list[Placed]:
    for placed in shapes:
        if not np.isfinite(placed.pose.position).all():
            raise ManipulationError(f"pose of {name!r} should be finite but is {placed.pose}")
    return [(_coal_shape(placed.shape, name), to_se3(placed.pose)) for placed in shapes]


def _coal_shape(shape: Shape, name: str) -> coal.CollisionGeometry:
    sizes: tuple[float, ...]
    match shape:
        case Box():
            sizes, geometry = shape.size, coal.Box(*shape.size)
        case Cylinder():
            sizes, geometry = (shape.radius, shape.length), coal.Cylinder(shape.radius, shape.length)
        case Sphere():
            sizes, geometry = (shape.radius,), coal.Sphere(shape.radius)
        case Mesh():
            mesh = coal.BVHModelOBBRSS()
            mesh.beginModel(len(shape.faces), len(shape.vertices))
            mesh.addVertices(np.asarray(shape.vertices, dtype=float))
            mesh.addTriangles(np.asarray(shape.faces, dtype=np.int64))
            mesh.endModel()
            return _convex(mesh)
    if not all(math.isfinite(size) and size > 0.0 for size in sizes):
        raise ManipulationError(f"shape of {name!r} should have positive finite sizes but is {shape}")
    return geometry


def _corners(shape: coal.CollisionGeometry) -> NDArray[np.float64] | None:
    """Return points (N, 3) whose convex hull is, nearly, the shape; None for voxels."""
    match shape:
        case coal.ConvexBase():
            return np.array(shape.points())
        case coal.Box():
            return box_corners(shape.halfSide)
        case coal.Cylinder() | coal.Sphere():
            turns = np.linspace(0.0, 2 * math.pi, 24, endpoint=False)
            ring = shape.radius * np.stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))], axis=1)
            if isinstance(shape, coal.Sphere):
                return np.concatenate([ring, ring[:, [1, 2, 0]], ring[:, [2, 0, 1]]])
            top = np.array([0.0, 0.0, shape.halfLength])
            return np.concatenate([ring + top, ring - top])
        case _:
            return None


def _convex(mesh: coal.BVHModelBase) -> coal.ConvexBase:
    # buildConvexRepresentation would take the mesh's own triangles as the hull: false clearance where it is concave.
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex
