"""Rendered tables on which known objects stand close together and hide parts of each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.rendered_table import RenderedTable, TrueObject, colored_parts, mast_camera, render_table
from benchmarks.rendering import DepthNoise, occlusion
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.pose_estimation.model_surface import model_surface

MIN_GAP = 0.03
MAX_OCCLUSION = 0.30


def crowded_table(
    seed: int,
    models: Sequence[ObjectModel],
    count: tuple[int, int] = (3, 6),
    counter: bool | None = None,
    noise: DepthNoise | None = None,
    always: Sequence[ObjectModel] = (),
) -> RenderedTable:
    """``always``, and others of ``models``: from ``count[0]`` to ``count[1]`` different ones, upright, at any yaw.

    Two in three stand 3 to 8 cm from another (between the outlines seen from above), many of these before or behind
    it; no gap is smaller. Of none do the others hide more than 30 % of its pixels, and all lie in the image.
    """
    rng = np.random.default_rng(seed)
    counter = bool(rng.random() < 0.5) if counter is None else counter
    size = (0.6, 1.2) if counter else (0.8, 1.2)
    table = Pose.from_xyz_rpy(
        (0.30 + rng.uniform(0.0, 0.12) + size[0] / 2, rng.uniform(-0.1, 0.1), 0.9 if counter else 0.75),
        (0, 0, rng.uniform(-0.06, 0.06)),
    )
    camera = mast_camera(math.radians(rng.uniform(40.0, 50.0)), rng.uniform(-0.15, 0.15))
    wanted = int(rng.integers(count[0], count[1] + 1))
    placed: list[TrueObject] = []
    others = [models[i] for i in rng.permutation(len(models)) if models[i] not in always]
    for model in [*always, *others][: max(wanted, len(always))]:
        for _ in range(60):
            item = TrueObject(model, _somewhere(model, placed, table, size, camera, rng), True)
            if _gap(item, placed) >= MIN_GAP and hidden_shares([*placed, item], camera).max() <= MAX_OCCLUSION:
                placed.append(item)
                break
    return render_table(placed, table, size, rng, counter, noise, camera)


def hidden_shares(items: Sequence[TrueObject], camera: Pose) -> NDArray[np.float64]:
    """The share of each object's pixels that the others hide."""
    return occlusion([[part for part, _ in colored_parts(item.model, item.pose)] for item in items], camera)


def _somewhere(
    model: ObjectModel,
    placed: Sequence[TrueObject],
    table: Pose,
    size: tuple[float, float],
    camera: Pose,
    rng: np.random.Generator,
) -> Pose:
    lower, upper = np.array([-size[0] / 2 + 0.08, -0.35]), np.array([min(size[0] / 2 - 0.08, 0.15), 0.35])
    yaw = rng.uniform(-math.pi, math.pi)
    x, y = rng.uniform(lower, upper)
    if placed and rng.random() < 2 / 3:
        other = table.inverse().apply(placed[int(rng.integers(len(placed)))].pose.position)
        direction, gap = rng.uniform(-math.pi, math.pi), rng.uniform(MIN_GAP, 0.08)
        if rng.random() < 0.6:
            # Before or behind the other, as the camera sees it.
            line = other[:2] - table.inverse().apply(camera.position)[:2]
            direction = math.atan2(line[1], line[0]) + rng.normal(0.0, 0.35) + math.pi * rng.integers(2)
        away = np.array([math.cos(direction), math.sin(direction)])
        # Moved outwards in steps until the gap is as wide as drawn.
        for distance in np.arange(0.02, 0.40, 0.004):
            x, y = other[:2] + distance * away
            item = TrueObject(model, _standing(model, table, x, y, yaw), True)
            if _gap(item, placed) >= gap:
                break
        x, y = np.clip([x, y], lower, upper)
    return _standing(model, table, x, y, yaw)


def _standing(model: ObjectModel, table: Pose, x: float, y: float, yaw: float) -> Pose:
    return table @ Pose.from_xyz_rpy((x, y, -float(model.bounds()[0, 2])), (0.0, 0.0, yaw))


def _gap(item: TrueObject, others: Sequence[TrueObject]) -> float:
    """Metres between the outlines seen from above; 0 where they overlap."""
    return min((_polygon_distance(_outline(item), _outline(other)) for other in others), default=math.inf)


def _outline(item: TrueObject) -> NDArray[np.float64]:
    corners = _footprint(item.model)
    return item.pose.apply(np.column_stack([corners, np.zeros(len(corners))]))[:, :2]


@cache
def _footprint(model: ObjectModel) -> NDArray[np.float64]:
    points = model_surface(model, Pose(), 0.003).points[:, :2]
    hull: NDArray[np.float64] = cv2.convexHull((1000.0 * points).astype(np.float32))[:, 0].astype(np.float64) / 1000.0
    return hull


def _polygon_distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Between two convex polygons; 0 where they overlap."""
    common, _ = cv2.intersectConvexConvex((1000.0 * a).astype(np.float32), (1000.0 * b).astype(np.float32))
    return 0.0 if common > 0.0 else min(_corner_distance(a, b), _corner_distance(b, a))


def _corner_distance(corners: NDArray[np.float64], polygon: NDArray[np.float64]) -> float:
    sides = np.roll(polygon, -1, axis=0) - polygon
    offsets = corners[:, None] - polygon
    along = np.clip((offsets * sides).sum(axis=2) / (sides**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(offsets - along[..., None] * sides, axis=2).min())
