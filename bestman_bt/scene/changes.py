"""Changes since the map was made: moved furniture, and unmapped furniture."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.placing import body_outlines
from bestman_bt.scene.plane_geometry import Points, polygons_overlap, rectangle
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture

if TYPE_CHECKING:
    from bestman_bt.scene.scene_config import RegionConfig, SceneConfig

_APART = 0.05
_AROUND_ROBOT = 1.0  # side of the square that stays free at its start, metres
_TRIES = 200


def exactly_placed(scene: SceneConfig, generator: Callable[[str], np.random.Generator]) -> tuple[PlacedFurniture, ...]:
    """Return the present unmapped furniture with an exact place. ``generator``: as below."""
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
    """Return the furniture with the moved and unmapped pieces, or None if one of them cannot be placed.

    Such a piece may be an obstacle, but must not cut off floor that a disc of the scene's ``passage`` could reach,
    except the floor that it covers. A moved piece without such a place must not cut off more floor than at its old
    place. ``standing``: outlines of walls and open doors. ``robot``: start pose. ``generator``: random numbers by a
    piece's name.
    """
    pieces = list(furniture)
    for index, piece in enumerate(furniture):
        far = scene.file.furniture[piece.name].moved if piece.mapped else 0.0
        if far > 0.0:
            rest = [*standing, *(line for other in pieces if other is not piece for line in body_outlines(other))]
            spans = [(c - far, c + far) for c in piece.nominal.xy]
            floor = _Floor(rest, robot, scene.file.passage)
            moved = floor.place(piece.model, (*spans, (-math.pi, math.pi)), generator(piece.name), stood=piece.actual)
            if moved is None:
                return None
            pieces[index] = replace(piece, actual=moved)
    for name, asked in scene.file.unmapped.items():
        region, rng = asked.region or scene.file.robot_start, generator(name)
        assert region is not None
        if asked.at is not None or float(rng.random()) >= asked.presence:
            continue
        rest = [*standing, *(line for other in pieces for line in body_outlines(other))]
        place = _Floor(rest, robot, scene.file.passage).place(scene.unmapped[name], _limits(region), rng)
        if place is None:
            return None
        pieces.append(_unmapped(scene, name, place))
    return tuple(pieces)


def _unmapped(scene: SceneConfig, name: str, place: Pose2D) -> PlacedFurniture:
    opened = scene.file.unmapped[name].open
    return PlacedFurniture(name, scene.unmapped[name], place, place, open=opened, mapped=False)


class _Floor:
    """The floor without the piece to place: the ``taken`` area, and the part of the rest that a disc reaches."""

    def __init__(self, taken: Sequence[Points], robot: Pose2D, passage: float) -> None:
        kept_free = rectangle(Pose2D(robot.x, robot.y, 0.0), (_AROUND_ROBOT, _AROUND_ROBOT))
        self._taken, self._passage = (*taken, kept_free), passage
        self._grid = FloorGrid.of(taken)
        self._reached = self._grid.largest_area(passage)

    def place(
        self,
        model: FurnitureModel,
        limits: Sequence[tuple[float, float]],
        rng: np.random.Generator,
        stood: Pose2D | None = None,
    ) -> Pose2D | None:
        """Return a pose within the limits of x, y and yaw, beside all that is taken, that leaves a way.

        Where there is none, one that cuts off no more than the piece did where it ``stood``.
        """
        depth, width = model.footprint
        in_reach = self._in_reach(limits, math.hypot(depth, width) / 2 + 2 * _APART)
        reached_before = None if stood is None else self._beside(stood, model)[0]
        second_best: Pose2D | None = None
        for _ in range(_TRIES):
            x, y, yaw = (float(rng.uniform(*limit)) for limit in limits)
            pose = Pose2D(x, y, yaw)
            grown = rectangle(pose, (depth + 2 * _APART, width + 2 * _APART))
            if any(polygons_overlap(grown, other) for other in in_reach):
                continue
            reached, has_room = self._beside(pose, model)
            cut_off = has_room & ~reached
            if not np.any(self._reached & cut_off):
                return pose
            if second_best is None and reached_before is not None and not np.any(reached_before & cut_off):
                second_best = pose
        return second_best

    def _in_reach(self, limits: Sequence[tuple[float, float]], radius: float) -> list[Points]:
        """Return the occupied outlines that a piece of this radius can touch within the limits."""
        (x_min, x_max), (y_min, y_max) = limits[:2]
        low, high = np.array([x_min, y_min]) - radius, np.array([x_max, y_max]) + radius
        return [line for line in self._taken if np.all(line.max(axis=0) >= low) and np.all(line.min(axis=0) <= high)]

    def _beside(self, pose: Pose2D, model: FurnitureModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return (rows, columns) where the disc can get with the piece in place, and where it fits."""
        grid = self._grid.beside(rectangle(pose, model.footprint), self._passage)
        return grid.largest_area(self._passage), grid.room > self._passage


def _limits(region: RegionConfig) -> tuple[tuple[float, float], ...]:
    return region.x, region.y, region.yaw
