"""The camera of a film: it follows the robot from the side with the best view."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from bestman_bt.evaluation.film.filmed_run import FilmedRun
from bestman_bt.evaluation.film.replay_scene import ReplayScene
from bestman_bt.visualization.snapshot import RobotSnapshot
from hal.simulation.bodies import Viewpoint

RATE = 12
"""Frames per second."""
SECONDS = (8.0, 13.0)
"""Shortest and longest film; a shorter run is shown at its original speed."""
SHORTEST = 0.5
AZIMUTHS = np.arange(12) * math.pi / 6
ELEVATIONS = (math.radians(25.0), math.radians(40.0))
DISTANCE = 2.3
FIELD_OF_VIEW = 42.0
ENOUGH = (0.004, 0.01)
"""Shares of the picture at which the hand and what it handles are seen well enough."""
KEY_MOMENTS = 10


@dataclass(frozen=True)
class Shot:
    """``times``: of the frames, seconds of the run. ``targets``: (N, 3), points to look at. ``speed``: playback speed
    factor.
    """

    times: tuple[float, ...]
    snapshots: tuple[RobotSnapshot, ...]
    targets: NDArray[np.float64]
    azimuth: float
    elevation: float
    speed: float

    def view(self, index: int) -> Viewpoint:
        """Return the viewpoint of one frame."""
        return viewpoint(self.targets[index], self.azimuth, self.elevation)

    def view_at(self, time: float) -> Viewpoint:
        """Return the viewpoint at any second of the run, interpolated between frames."""
        target = np.array([np.interp(time, self.times, self.targets[:, axis]) for axis in range(3)])
        return viewpoint(target, self.azimuth, self.elevation)


def viewpoint(target: NDArray[np.float64], azimuth: float, elevation: float) -> Viewpoint:
    """Return a viewpoint at DISTANCE metres, ``azimuth`` and ``elevation`` radians in the map frame."""
    away = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    x, y, z = (float(value) for value in target + DISTANCE * away)
    a, b, c = (float(value) for value in target)
    return Viewpoint((x, y, z), (a, b, c), FIELD_OF_VIEW)


def plan_shot(run: FilmedRun, stage: ReplayScene) -> Shot:
    """Choose the frames, let the camera follow, choose the side."""
    duration = run.motion.duration
    seconds = max(min(max(duration / 4.0, SECONDS[0]), SECONDS[1], duration), SHORTEST)
    times = tuple(float(time) for time in np.linspace(0.0, duration, round(seconds * RATE)))
    snapshots = tuple(run.motion.at(time) for time in times)
    hands = []
    for snapshot in snapshots:
        stage.set(snapshot)
        hands.append(stage.hand())
    bases = np.array([snapshot.map_from_base.position for snapshot in snapshots])
    middle = 0.35 * bases + 0.65 * np.array(hands)
    middle[:, 2] = 0.75
    targets = gaussian_filter1d(middle, sigma=0.8 * RATE, axis=0, mode="nearest")
    moved = np.linalg.norm(np.gradient(bases, axis=0), axis=1)
    standing = np.flatnonzero(moved < 1e-3) if (moved < 1e-3).any() else np.arange(len(times))
    keys = standing[np.linspace(0, len(standing) - 1, KEY_MOMENTS).round().astype(int)]

    def score(side: tuple[float, float]) -> float:
        """How well hand and subjects are seen while the base stands."""
        total = 0.0
        for index in keys:
            stage.set(snapshots[index])
            total += _clearness(stage.seen(viewpoint(targets[index], *side), run.subjects), 1.0)
        return total

    azimuth, elevation = max(((float(a), e) for a in AZIMUTHS for e in ELEVATIONS), key=score)
    return Shot(times, snapshots, targets, azimuth, elevation, duration / seconds)


def best_frame(run: FilmedRun, shot: Shot, stage: ReplayScene) -> int:
    """Return the index of the frame that shows the hand's work best, after it starts moving."""
    begun = [i for i, now in enumerate(shot.snapshots) if _moved(shot.snapshots[0], now, run.subjects)] or [0]
    candidates = sorted({begun[round(k)] for k in np.linspace(0, len(begun) - 1, 2 * KEY_MOMENTS)})

    def score(index: int) -> float:
        stage.set(shot.snapshots[index])
        return _clearness(stage.seen(shot.view(index), run.subjects), 1.5)

    best: int = max(candidates, key=score)
    return best


def _clearness(shares: tuple[float, float], most: float) -> float:
    return sum(min(share / enough, most) for share, enough in zip(shares, ENOUGH, strict=True))


def _moved(before: RobotSnapshot, now: RobotSnapshot, subjects: tuple[str, ...]) -> bool:
    """Return whether any of them is 3 cm or 2 degrees from where it was."""
    for name in subjects:
        was, is_now = before.body_poses[name], now.body_poses[name]
        turned = 2.0 * math.acos(min(1.0, abs(float(was.quaternion @ is_now.quaternion))))
        if np.linalg.norm(is_now.position - was.position) > 0.03 or turned > math.radians(2.0):
            return True
    return False
