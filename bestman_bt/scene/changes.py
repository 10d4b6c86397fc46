"""What has changed since the map was made: furniture that was moved, and furniture that the map does not have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bestman_bt.messages import Pose2D
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.plane_geometry import Points, polygons_overlap, rectangle
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture
from bestman_bt.scene.standing_outlines import body_outlines

if TYPE_CHECKING:
    from bestman_bt.scene.load import SceneConfig
    from bestman_bt.scene.scene_config import RegionConfig

_APART = 0.05
_AROUND_ROBOT = 1.0  # side of the square that stays free at its start, metres
_TRIES = 200


def exactly_placed(scene: SceneConfig, generator: Callable[[str], np.random.Generator]) -> tuple[PlacedFurniture, ...]:
    """The unmapped furniture that the scene has at one place, as far as it came. ``generator``: as below."""
    return tuple(
        _unmapped(scene, name, Pose2D(*asked.at))
        for name, asked in scene.file.unmapped.items()
        if asked.at is not None and float(generator(name).random()) < asked.presence
    )


def draw_changes(
    scene: SceneConfig,
    furniture: Sequence[PlacedFurniture],
    standing: Sequence[Points],
    robot: Pose2D,
    generator: Callable[[str], np.random.Generator],
) -> tuple[PlacedFurniture, ...] | None:
    """The furniture with what was moved and what came; None where something finds no place.

    It may stand in the way, but what a disc of the scene's ``passage`` could reach without it, it still reaches, save
    what the piece itself takes. ``standing``: outlines of walls and open doors. ``robot``: where it starts.
    ``generator``: random numbers by a piece's name.
    """
    pieces = list(furniture)
    for index, piece in enumerate(furniture):
        far = scene.file.furniture[piece.name].moved if piece.mapped else 0.0
        if far > 0.0:
            rest = [*standing, *(line for other in pieces if other is not piece for line in body_outlines(other))]
            spans = [(c - far, c + far) for c in piece.nominal.xy]
            moved = _place(piece.model, (*spans, (-math.pi, math.pi)), rest, robot, scene, generator(piece.name))
            if moved is None:
                return None
            pieces[index] = replace(piece, actual=moved)
    for name, asked in scene.file.unmapped.items():
        region, rng = asked.region or scene.file.robot_start, generator(name)
        assert region is not None
        if asked.at is not None or float(rng.random()) >= asked.presence:
            continue
        rest = [*standing, *(line for other in pieces for line in body_outlines(other))]
        place = _place(scene.unmapped[name], _limits(region), rest, robot, scene, rng)
        if place is None:
            return None
        pieces.append(_unmapped(scene, name, place))
    return tuple(pieces)


def _unmapped(scene: SceneConfig, name: str, place: Pose2D) -> PlacedFurniture:
    opened = scene.file.unmapped[name].open
    return PlacedFurniture(name, scene.unmapped[name], place, place, open=opened, mapped=False)


def _place(
    model: FurnitureModel,
    limits: Sequence[tuple[float, float]],
    taken: Sequence[Points],
    robot: Pose2D,
    scene: SceneConfig,
    rng: np.random.Generator,
) -> Pose2D | None:
    """A pose within the limits of x, y and yaw, beside all that is ``taken``, that leaves a way."""
    kept_free = rectangle(Pose2D(robot.x, robot.y, 0.0), (_AROUND_ROBOT, _AROUND_ROBOT))
    depth, width = model.footprint
    before = FloorGrid.of(taken)
    reached = before.largest_area(scene.file.passage)
    for _ in range(_TRIES):
        x, y, yaw = (float(rng.uniform(*limit)) for limit in limits)
        pose = Pose2D(x, y, yaw)
        grown = rectangle(pose, (depth + 2 * _APART, width + 2 * _APART))
        if any(polygons_overlap(grown, other) for other in (*taken, kept_free)):
            continue
        after = FloorGrid.of([*taken, rectangle(pose, model.footprint)])
        lost = reached & ~after.largest_area(scene.file.passage) & (after.room > scene.file.passage)
        if not lost.any():
            return pose
    return None


def _limits(region: RegionConfig) -> tuple[tuple[float, float], ...]:
    return region.x, region.y, region.yaw
