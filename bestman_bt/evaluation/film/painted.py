"""A run's frames for Blender: what each body is made of, and which walls are left out so that one sees in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from bestman_bt.evaluation.film.filmed_run import FilmedRun
from bestman_bt.evaluation.recording import recorded_bodies
from bestman_bt.scene import Wall, World
from bestman_bt.visualization import RobotSnapshot
from bestman_bt.visualization.blender import Finish, PaintedBody, PaintedFrame, PaintedRobot, PaintJob
from hal.simulation import Viewpoint

BEHIND = 0.35
"""Metres behind what is looked at in which a wall still hides it."""


def paint_job(
    run: FilmedRun,
    frames: Sequence[tuple[RobotSnapshot, Viewpoint]],
    files: Sequence[Path],
    size: tuple[int, int],
    samples: int,
) -> PaintJob:
    """The job that paints ``frames`` into ``files``; ``size``: width and height in pixels."""
    views = [view for _, view in frames]
    hidden = {name for name, wall in _walls(run.world) if any(_hides(wall, view) for view in views)}
    return PaintJob(
        robot=PaintedRobot(run.robot_model.urdf, run.robot_model.base_frame),
        bodies=list(_painted_bodies(run.world)),
        frames=[
            PaintedFrame(snapshot, view.eye, view.target, view.field_of_view, file)
            for (snapshot, view), file in zip(frames, files, strict=True)
        ],
        hidden=frozenset(hidden),
        width=size[0],
        height=size[1],
        samples=samples,
        seed=run.config.seed,
    )


def _painted_bodies(world: World) -> Iterable[PaintedBody]:
    finishes: dict[str, Finish] = {name: "wall" for name, _ in _walls(world)}
    finishes |= {thing.name: "object" for thing in world.objects}
    finishes |= {walker.name: "person" for walker in world.walkers}
    for body in recorded_bodies(world):
        yield PaintedBody(body, finishes.get(body.name, "furniture"))


def _walls(world: World) -> list[tuple[str, Wall]]:
    """With the names that they have as bodies."""
    return [(f"wall{number}", wall) for number, wall in enumerate(world.walls)]


def _hides(wall: Wall, view: Viewpoint) -> bool:
    """Whether a wall stands between the camera and what it looks at, in plan, or right behind the camera."""
    eye, target = np.array(view.eye[:2]), np.array(view.target[:2])
    away = target - eye
    length = float(np.linalg.norm(away))
    direction = away / length if length > 0 else np.array([1.0, 0.0])
    side = np.array([-direction[1], direction[0]])
    start, end = (np.array(point) - eye for point in (wall.start, wall.end))
    reach = length - BEHIND
    for share in np.linspace(0.0, 1.0, 40):
        point = start + share * (end - start)
        ahead, across = float(point @ direction), float(point @ side)
        if -BEHIND < ahead < reach and abs(across) < 0.5 * max(ahead, 0.0) + BEHIND:
            return True
    return False
