"""Segmentation of things that stand close: split and merge rates over the gap between them, and time."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.rendered_table import (
    RenderedTable,
    TrueObject,
    known_models,
    render_table,
    solid,
    tumbler,
    unknown_model,
)
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.segmentation.base import Cluster, Segmentation
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing

GAPS = (0.0, 0.005, 0.010, 0.020, 0.030)


def composites() -> tuple[ObjectModel, ...]:
    """Things with concave outlines: a mug with a handle, a bottle with a neck, a duck of two balls and a beak."""
    handle = [PlacedShape(Box((0.022, 0.010, 0.008)), Pose.from_xyz_rpy((0.048, 0.0, z))) for z in (-0.022, 0.022)] + [
        PlacedShape(Box((0.008, 0.010, 0.052)), Pose.from_xyz_rpy((0.060, 0.0, 0.0)))
    ]
    mug = (PlacedShape(tumbler(0.040, 0.095), Pose()), *handle)
    bottle = (
        PlacedShape(Cylinder(0.033, 0.15), Pose.from_xyz_rpy((0.0, 0.0, -0.04))),
        PlacedShape(Cylinder(0.013, 0.08), Pose.from_xyz_rpy((0.0, 0.0, 0.075))),
    )
    duck = (
        PlacedShape(Sphere(0.045), Pose.from_xyz_rpy((0.0, 0.0, -0.020))),
        PlacedShape(Sphere(0.026), Pose.from_xyz_rpy((0.028, 0.0, 0.040))),
        PlacedShape(Box((0.022, 0.018, 0.008)), Pose.from_xyz_rpy((0.060, 0.0, 0.036))),
    )
    extents = {"mug": (0.10, 0.08, 0.095), "bottle": (0.066, 0.066, 0.23), "duck": (0.09, 0.09, 0.13)}
    shapes = {"mug": mug, "bottle": bottle, "duck": duck}
    return tuple(
        ObjectModel(name, (0.8, 0.7, 0.2), 0.2, 0.8, (PlacedShape(Box(extents[name]), Pose()),), shapes[name])
        for name in shapes
    )


def close_pairs(seed: int, gap: float, pairs: int = 3) -> RenderedTable:
    """A table with ``pairs`` pairs of things; the two of a pair stand ``gap`` metres apart."""
    rng = np.random.default_rng(seed)
    pool = [*known_models(int(rng.integers(3))), *composites(), solid("ball", Sphere(0.035), (0.9, 0.4, 0.1), 0)]
    table = Pose.from_xyz_rpy((0.36 + 0.4, 0.0, 0.75), (0.0, 0.0, rng.uniform(-0.06, 0.06)))
    placed: list[TrueObject] = []
    while len(placed) < 2 * pairs:
        first, second = (
            pool[int(rng.integers(len(pool)))] if rng.random() < 0.7 else unknown_model(rng, known_models())
            for _ in range(2)
        )
        x, y = rng.uniform([-0.28, -0.36], [0.15, 0.36])
        one = _standing(table, first, x, y, rng.uniform(-math.pi, math.pi))
        direction, yaw = rng.uniform(-math.pi, math.pi, 2)
        low, high = 0.0, 0.4
        for _ in range(12):
            middle = (low + high) / 2
            other = _standing(table, second, x + middle * math.cos(direction), y + middle * math.sin(direction), yaw)
            low, high = (middle, high) if _distance(one, other) < gap + 0.001 else (low, middle)
        other = _standing(table, second, x + high * math.cos(direction), y + high * math.sin(direction), yaw)
        on_table = np.abs(table.inverse().apply(other.pose.position)[:2]) < (0.32, 0.45)
        if on_table.all() and all(_distance(item, thing) > 0.06 for item in (one, other) for thing in placed):
            placed += [one, other]
    return render_table(placed, table, (0.8, 1.2), rng)


def judge(clusters: Sequence[Cluster], objects: Sequence[TrueObject]) -> tuple[int, int, int]:
    """How many objects are one clean cluster, how many are split, how many share a cluster with another."""
    trees = [cKDTree(_surface(item)) for item in objects]
    shares = np.zeros((len(clusters), len(objects)))
    for row, cluster in enumerate(clusters):
        nearest = np.argmin([tree.query(cluster.points)[0] for tree in trees], axis=0)
        shares[row] = np.bincount(nearest, minlength=len(objects))
    right = split = merged = 0
    for column in range(len(objects)):
        mine = shares[:, column]
        large = np.flatnonzero(mine > max(8.0, 0.12 * mine.sum()))
        others = [np.delete(shares[row], column).max(initial=0.0) > max(8.0, 0.12 * shares[row].sum()) for row in large]
        split += len(large) > 1
        merged += any(others)
        right += len(large) == 1 and not any(others)
    return right, split, merged


def measure(seed: int, scenes: int = 12, methods: dict[str, Segmentation] | None = None) -> dict[str, object]:
    """Rates and times of each method for each gap, over scenes that ``seed`` gives."""
    methods = methods or {"region_growing": RegionGrowing(), "plane_dbscan": PlaneDbscan()}
    counts = {name: {gap: np.zeros(4, dtype=int) for gap in GAPS} for name in methods}
    times: dict[str, list[float]] = {name: [] for name in methods}
    for gap in GAPS:
        for number in range(scenes):
            scene = close_pairs(seed * 1000 + number, gap)
            for name, method in methods.items():
                start = time.process_time()
                try:
                    clusters = method.segment(scene.view, scene.region, np.random.default_rng(number)).clusters
                except PerceptionError:
                    clusters = ()
                times[name].append((time.process_time() - start) * 1e3)
                counts[name][gap] += (*judge(clusters, scene.objects), len(scene.objects))
    result: dict[str, object] = {"seed": seed}
    for name in methods:
        result[f"{name}_ms"] = round(float(np.median(times[name])), 1)
        for kind, column in (("right", 0), ("split", 1), ("merged", 2)):
            result[f"{name}_{kind}_rate"] = {
                f"{1e3 * gap:.0f} mm": round(float(counts[name][gap][column] / counts[name][gap][3]), 3) for gap in GAPS
            }
    return result


def _standing(table: Pose, model: ObjectModel, x: float, y: float, yaw: float) -> TrueObject:
    bottom = min(float(_placed_points(part)[:, 2].min()) for part in model.visual or model.collision)
    return TrueObject(model, table @ Pose.from_xyz_rpy((x, y, -bottom), (0.0, 0.0, yaw)), False)


def _placed_points(part: PlacedShape) -> NDArray[np.float64]:
    return part.pose.apply(sample_shape(part.shape, 0.005)[0])


def _surface(item: TrueObject) -> NDArray[np.float64]:
    parts = item.model.visual or item.model.collision
    return item.pose.apply(np.concatenate([_placed_points(part) for part in parts]))


def _distance(one: TrueObject, other: TrueObject) -> float:
    """Between the footprints, metres: things do not lean over each other."""
    first, second = _surface(one)[:, :2], _surface(other)[:, :2]
    return float(cKDTree(first).query(second)[0].min())
