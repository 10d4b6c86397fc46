"""Tables with things to grasp: drawn by a seed, each thing as physics lets it lie, gaps between them as asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from benchmarks.rendering import occlusion
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.segmentation.base import Region
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, PlacedObject, World
from hal.pybullet.body_urdf import body_urdf
from hal.pybullet.package import pybullet

TABLE_SIZE, TOP_THICKNESS = (0.8, 1.2), 0.04
MAST = (-0.2, 0.0, 1.65)
"""Where the head camera stands over the robot's base, which is at the origin."""
MAX_HIDDEN = 0.30
OPTICAL = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (-math.pi / 2, 0.0, -math.pi / 2))
REACH = ((-0.30, 0.10), (-0.30, 0.30))
"""Where on the table things stand: x from its middle, towards the robot negative, and y; metres."""


@dataclass(frozen=True)
class GraspScene:
    """A world, and what the robot believes of it: ``region``, its table, off by up to 3 cm and 2°.

    ``table_height``: true z of the surface. ``head``: where the camera is, looking along x.
    """

    world: World
    region: Region
    table_height: float
    head: Pose


def draw_scene(seed: int, things: Sequence[tuple[ObjectModel, Pose]], gap: tuple[float, float]) -> GraspScene:
    """Put ``things`` on a table, each turned about z at random from the orientation that its pose gives.

    The names in the world are ``thing_0`` and so on. ``gap``: least and largest distance (metres, outlines seen from
    above) of each thing from its nearest neighbour among those before it. Of the first one, the others hide at most
    MAX_HIDDEN from the head camera.
    """
    rng = np.random.default_rng([seed, 1])
    height = float(rng.uniform(0.70, 0.90))
    table = Pose2D(0.32 + float(rng.uniform(0.0, 0.1)) + TABLE_SIZE[0] / 2, float(rng.uniform(-0.1, 0.1)), 0.0)
    head = Pose.from_xyz_rpy(MAST, (0.0, math.radians(float(rng.uniform(40.0, 50.0))), float(rng.uniform(-0.15, 0.15))))
    x, y, turn = (float(v) for v in rng.uniform(-1.0, 1.0, 3) * (0.03, 0.03, 0.035))
    for _ in range(200):
        poses: list[Pose] = []
        for model, lying in things:
            others = [_outline(other, pose) for (other, _), pose in zip(things, poses, strict=False)]
            found = _place(model, lying, others, gap, table, height, rng)
            if found is None:
                break
            poses.append(found)
        if len(poses) == len(things) and _hidden([model for model, _ in things], poses, head) <= MAX_HIDDEN:
            break
    else:
        raise RuntimeError(f"no room for {len(things)} things on a table with seed {seed}")
    placed = zip(things, poses, strict=True)
    objects = tuple(PlacedObject(f"thing_{i}", model, pose) for i, ((model, _), pose) in enumerate(placed))
    furniture = PlacedFurniture("table", _table(height), table, table)
    world = World("grasps", seed, (), (furniture,), objects, Pose2D(), {})
    region = Region((table @ Pose2D(x, y, turn)).to_pose(height), (TABLE_SIZE[0] + 0.1, TABLE_SIZE[1] + 0.1))
    return GraspScene(world, region, height, head)


@cache
def standing(model: ObjectModel) -> Pose:
    """Upright, lowest point at z = 0."""
    return Pose(np.array([0.0, 0.0, -float(_points(model)[:, 2].min())]))


def resting(model: ObjectModel, rng: np.random.Generator) -> Pose:
    """As the object lies 2 s after it was dropped from 1 cm, turned at random; x and y of the pose are 0."""
    turn = rng.normal(size=4)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "thing.urdf"
            seen = [(part, (0.5, 0.5, 0.5, 1.0)) for part in model.collision[:1]]
            file.write_text(body_urdf("thing", model.mass, model.collision, seen), encoding="utf-8")
            start = Pose(np.zeros(3), turn / np.linalg.norm(turn))
            lift = 0.01 - float(start.apply(_points(model))[:, 2].min())
            body = pybullet.loadURDF(str(file), [0, 0, lift], start.quaternion.tolist(), physicsClientId=client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        floor = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
        for part in (floor, body):
            pybullet.changeDynamics(
                part, -1, lateralFriction=model.friction, rollingFriction=0.001, physicsClientId=client
            )
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        for _ in range(480):
            pybullet.stepSimulation(physicsClientId=client)
        quaternion = np.array(pybullet.getBasePositionAndOrientation(body, physicsClientId=client)[1])
    finally:
        pybullet.disconnect(client)
    lying = Pose(np.zeros(3), quaternion)
    return Pose(np.array([0.0, 0.0, -float(lying.apply(_points(model))[:, 2].min())]), quaternion)


def _place(
    model: ObjectModel,
    lying: Pose,
    others: Sequence[NDArray[np.float64]],
    gap: tuple[float, float],
    table: Pose2D,
    height: float,
    rng: np.random.Generator,
) -> Pose | None:
    """A free place; after the first thing, one that is ``gap`` from the nearest other. None after 300 tries."""
    trees = [cKDTree(other) for other in others]
    for _ in range(300):
        x, y = (float(rng.uniform(*ends)) for ends in REACH)
        turned = Pose.from_xyz_rpy((x, y, height + 0.001), (0.0, 0.0, float(rng.uniform(-math.pi, math.pi))))
        pose = table.to_pose() @ turned @ lying
        outline = _outline(model, pose)
        distance = min((float(tree.query(outline)[0].min()) for tree in trees), default=gap[0])
        inside = any(_inside(outline, other) for other in others)
        if not inside and gap[0] <= distance <= gap[1]:
            return pose
    return None


def _outline(model: ObjectModel, pose: Pose) -> NDArray[np.float64]:
    """Points every 3 mm along the convex outline seen from above, (N, 2) metres."""
    points = pose.apply(_points(model))[:, :2]
    corners = points[ConvexHull(points).vertices]
    following = np.roll(corners, -1, axis=0)
    steps = np.maximum(1, np.ceil(np.linalg.norm(following - corners, axis=1) / 0.003).astype(int))
    sides = zip(corners, following, steps, strict=True)
    return np.concatenate([a + np.linspace(0.0, 1.0, n, endpoint=False)[:, None] * (b - a) for a, b, n in sides])


def _hidden(models: Sequence[ObjectModel], poses: Sequence[Pose], head: Pose) -> float:
    """The share of the first thing that the others hide from the camera."""
    if len(models) == 1:
        return 0.0
    bodies = [
        [PlacedShape(part.shape, pose @ part.pose) for part in model.visual or model.collision]
        for model, pose in zip(models, poses, strict=True)
    ]
    others = [shape for body in bodies[1:] for shape in body]
    return float(occlusion([bodies[0], others], head @ OPTICAL)[0])


def _inside(outline: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two convex outlines overlap (a point of one lies in the other)."""
    for inner, outer in ((outline, other), (other, outline)):
        sides = np.roll(outer, -1, axis=0) - outer
        offsets = inner[:, None] - outer
        left = sides[:, 0] * offsets[..., 1] - sides[:, 1] * offsets[..., 0]
        if (left >= 0.0).all(axis=1).any():
            return True
    return False


@cache
def _points(model: ObjectModel) -> NDArray[np.float64]:
    return np.concatenate([placed.pose.apply(sample_shape(placed.shape, 0.005)[0]) for placed in model.collision])


def _table(height: float) -> FurnitureModel:
    body = height - TOP_THICKNESS
    top = PlacedShape(Box((*TABLE_SIZE, TOP_THICKNESS)), Pose(np.array([0.0, 0.0, height - TOP_THICKNESS / 2])))
    foot = PlacedShape(Box((0.5, 0.8, body)), Pose(np.array([0.0, 0.0, body / 2])))
    colors = ((0.75, 0.60, 0.42, 1.0), (0.55, 0.45, 0.33, 1.0))
    return FurnitureModel("table", TABLE_SIZE, (top, foot), colors, ())
