from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization.scan_to_map import cast_rays

BASE_FROM_LIDAR = Pose2D(0.1, 0.0, 0.05)
BEAMS = 360


@dataclass(frozen=True)
class Drive:
    """What a robot measured on its way: true poses, odometry, scans."""

    walls: np.ndarray
    true: list[Pose2D]
    odometry: list[Pose2D]
    scans: list[LaserScan]


def slab(x1, y1, x2, y2):
    """The outline of a wall or a piece of furniture that fills a rectangle."""
    return [(x1, y1, x2, y1), (x2, y1, x2, y2), (x2, y2, x1, y2), (x1, y2, x1, y1)]


@pytest.fixture(scope="session")
def rooms() -> np.ndarray:
    """Four rooms around a core, 9 by 8 m, with doorways so that a robot can go round; walls 10 cm thick; furniture."""
    segments = [(0, 0, 9, 0), (9, 0, 9, 8), (9, 8, 0, 8), (0, 8, 0, 0)]
    for low, high in [((3.2, 2.6), (5.8, 5.4))]:  # the core
        segments += slab(*low, *high)
    segments += slab(0, 3.95, 1.1, 4.05) + slab(2.0, 3.95, 3.2, 4.05)  # doorways of 0.9 m
    segments += slab(5.8, 3.95, 6.9, 4.05) + slab(7.8, 3.95, 9, 4.05)
    segments += slab(4.45, 0, 4.55, 0.8) + slab(4.45, 1.7, 4.55, 2.6)
    segments += slab(4.45, 5.4, 4.55, 6.3) + slab(4.45, 7.2, 4.55, 8)
    segments += slab(0, 0, 1.6, 0.6) + slab(7.9, 2.0, 8.5, 2.9) + slab(0, 6.5, 0.4, 7.7) + slab(6.0, 7.5, 7.6, 8)
    return np.array(segments, dtype=float)


def scan_at(pose, walls, rng, stamp=0.0, noise=0.01, reach=8.0):
    angles = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
    ranges, _ = cast_rays(walls, pose @ BASE_FROM_LIDAR, angles)
    ranges = ranges + rng.normal(0.0, noise, BEAMS)
    return LaserScan(np.where(ranges < reach, ranges, np.inf), -math.pi, 2 * math.pi / BEAMS, 0.1, reach, stamp)


def drive(walls, corners, rng, slip, speed=0.06, turn=0.12, **lidar):
    """Straight from corner to corner, turning on the spot; ``slip``: shares of way and turn that the wheels slip."""
    true, odometry, scans = [], [], []
    pose, counted = Pose2D(*corners[0], math.atan2(*(np.subtract(corners[1], corners[0])[::-1]))), Pose2D()
    rates = 1.0 + rng.normal(0.0, slip)
    bend = rng.normal(0.0, 0.2 * slip[1])  # radians per metre

    def step(move):
        nonlocal pose, counted
        pose = pose @ move
        felt = Pose2D(move.x * rates[0], 0.0, move.theta * rates[1] + bend * move.x)
        counted = counted @ felt
        true.append(pose)
        odometry.append(counted)
        scans.append(scan_at(pose, walls, rng, 0.1 * (len(true) - 1), **lidar))

    step(Pose2D())
    for corner in corners[1:]:
        way = np.subtract(corner, pose.xy)
        off = (math.atan2(way[1], way[0]) - pose.theta + math.pi) % (2 * math.pi) - math.pi
        count = max(1, math.ceil(abs(off) / turn))
        for _ in range(count):
            step(Pose2D(0.0, 0.0, off / count))
        length = float(np.linalg.norm(way))
        count = max(1, math.ceil(length / speed))
        for _ in range(count):
            step(Pose2D(length / count, 0.0, 0.0))
    return Drive(walls, true, odometry, scans)


ROUND = [(1.5, 2.0), (1.5, 6.6), (7.3, 6.7), (7.3, 1.3), (1.8, 1.3), (1.5, 5.5), (3.0, 6.6)]


@pytest.fixture(scope="session")
def round_drive(rooms) -> Drive:
    """Once round the core and on through the first doorway; wheels that slip by some 10 %."""
    return drive(rooms, ROUND, np.random.default_rng(5), slip=(0.1, 0.1))


@pytest.fixture(scope="session")
def short_sighted_drive(rooms) -> Drive:
    """The same way with a lidar that sees 2.5 m and errs by 2 cm: much drift, and loops that take it away."""
    rng = np.random.default_rng(5)
    return drive(rooms, ROUND, rng, slip=(0.1, 0.1), speed=0.1, turn=0.2, noise=0.02, reach=2.5)
