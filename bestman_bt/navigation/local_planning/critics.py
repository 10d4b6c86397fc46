"""Critics: the cost of a simulated drive, as in nav2's DWB and MPPI controllers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.shapes import NonNegative, Positive
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.cost_to_go import CostToGo, DistanceGrid
from bestman_bt.navigation.local_planning.footprint_check import FootprintCheck
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class CriticWeights:
    """Weights of the critics; a cost of 1 is worth a metre of path.

    ``goal``: remaining metres at the end of the drive or at a contact, ``goal_early``: mean over the drive. ``path``:
    mean distance from the path. ``obstacle``: per proximity to an obstacle, which falls to 1/e within
    ``obstacle_decay`` metres from the outline. ``heading``: radians off the path's direction after a third of the
    drive. ``backwards``, ``sideways``: per metre driven in these directions. ``turning``: per radian. ``contact``: for
    an immediate contact; less for a later one. ``prediction``: seconds of constant-velocity prediction of moving
    obstacles, ``moving_margin``: metres from their predicted positions, ``moving``: weight of approaching them closer
    than ``moving_distance``.
    """

    goal: Annotated[NonNegative, "1/m"] = 1.0
    goal_early: Annotated[NonNegative, "1/m"] = 0.4
    path: Annotated[NonNegative, "1/m"] = 0.35
    obstacle: NonNegative = 0.3
    obstacle_decay: Annotated[Positive, "m"] = 0.12
    heading: Annotated[NonNegative, "1/rad"] = 0.25
    backwards: Annotated[NonNegative, "1/m"] = 0.5
    sideways: Annotated[NonNegative, "1/m"] = 0.2
    turning: Annotated[NonNegative, "1/rad"] = 0.03
    contact: NonNegative = 10.0
    prediction: Annotated[NonNegative, "s"] = 1.2
    moving_margin: Annotated[NonNegative, "m"] = 0.08
    moving_distance: Annotated[NonNegative, "m"] = 0.5
    moving: NonNegative = 0.6


@dataclass(frozen=True, eq=False)
class Drives:
    """B simulated drives of T steps of ``dt`` seconds: poses after each, (B, T), map frame.

    ``twists``: the velocities (vx, vy, wz) of each step, three arrays (B, T) or (B, 1).
    """

    x: Floats
    y: Floats
    theta: Floats
    twists: tuple[Floats, Floats, Floats]
    dt: float


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The environment of drives. ``margin``: metres around the outline that must stay free."""

    distance: DistanceGrid
    to_go: CostToGo
    moving: list[MovingObstacle]
    margin: float


class Critics:
    """Computes the cost of drives of a base with a given footprint."""

    def __init__(self, weights: CriticWeights, footprint: Footprint, sideways: bool) -> None:
        self._weights, self._sideways = weights, sideways
        self._check = FootprintCheck(footprint)
        around = footprint.above  # who moves is tall
        edges = np.roll(around.corners, -1, axis=0) - around.corners
        normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
        self._normals = normals.astype(np.float32)
        self._offsets = np.einsum("ij,ij->i", normals, around.corners).astype(np.float32)
        self._reach = around.circumscribed_radius

    def judge(self, drives: Drives, around: Surroundings) -> tuple[Floats, NDArray[np.intp]]:
        """Return the cost of each drive (B,), and the step of its first contact, T without one."""
        p = self._weights
        steps = drives.x.shape[1]
        touches, middle = self._check.touches(around.distance, drives.x, drives.y, drives.theta, around.margin)
        left = around.to_go.field.at(drives.x[:, 1::2], drives.y[:, 1::2])
        beside = around.to_go.beside.at(drives.x[:, 1::4], drives.y[:, 1::4])
        near = np.exp((self._check.inner - middle) / np.float32(p.obstacle_decay))
        cost = np.float32(p.goal_early) * left.mean(axis=1)
        cost += np.float32(p.path) * beside.mean(axis=1) + np.float32(p.obstacle) * near.mean(axis=1)
        cost += self._heading(drives, around.to_go)
        vx, vy, wz = drives.twists
        duration = np.float32(drives.dt * steps)
        cost += np.float32(p.backwards) * duration * np.maximum(-vx, 0.0).mean(axis=1)
        cost += np.float32(p.turning) * duration * np.abs(wz).mean(axis=1)
        if self._sideways:
            cost += np.float32(p.sideways) * duration * np.abs(vy).mean(axis=1)
        for obstacle in around.moving:
            meets, nearness = self._meet(drives, obstacle)
            touches |= meets
            cost += np.float32(p.moving) * nearness
        first = np.where(touches.any(axis=1), touches.argmax(axis=1), steps)
        # A drive is worth what it reaches before it touches something; there is time to think again of what comes late.
        reached = left[np.arange(len(left)), np.minimum(first // 2, left.shape[1] - 1)]
        sooner = (1.0 - first / steps).astype(np.float32)
        cost += np.float32(p.goal) * reached + np.float32(p.contact) * sooner * sooner
        return cost, first

    def _heading(self, drives: Drives, to_go: CostToGo) -> Floats:
        step = drives.x.shape[1] // 3
        dx = np.float32(to_go.carrot[0]) - drives.x[:, step]
        dy = np.float32(to_go.carrot[1]) - drives.y[:, step]
        off = np.arctan2(dy, dx) - drives.theta[:, step]
        off = np.abs((off + np.float32(np.pi)) % np.float32(2 * np.pi) - np.float32(np.pi))
        # A carrot that has been reached says nothing about the heading any more.
        weight = np.minimum(np.hypot(dx, dy) / np.float32(0.4), np.float32(1.0))
        heading: Floats = np.float32(self._weights.heading) * off * weight
        return heading

    def _meet(self, drives: Drives, obstacle: MovingObstacle) -> tuple[NDArray[np.bool_], Floats]:
        """Return where the base and a moving disc touch (B, T), and how near they come, 0 (far) to 1, for each drive
        (B,).
        """
        p = self._weights
        steps = drives.x.shape[1]
        times = np.minimum((np.arange(steps) + 1) * drives.dt, p.prediction)
        dx = (obstacle.x + obstacle.vx * times).astype(np.float32) - drives.x
        dy = (obstacle.y + obstacle.vy * times).astype(np.float32) - drives.y
        apart = np.hypot(dx, dy) - np.float32(self._reach + obstacle.radius)
        gap = apart.copy()
        # Nearer than the circumscribed circle, the outline tells. Predictions further ahead are worth nothing.
        unsure = np.flatnonzero((apart < p.moving_margin).ravel())
        if len(unsure):
            cos, sin = np.cos(drives.theta.ravel()[unsure]), np.sin(drives.theta.ravel()[unsure])
            ux, uy = dx.ravel()[unsure], dy.ravel()[unsure]
            own = np.stack([cos * ux + sin * uy, cos * uy - sin * ux], axis=1)
            gap.ravel()[unsure] = (own @ self._normals.T - self._offsets).max(axis=1) - np.float32(obstacle.radius)
        predicted = (np.arange(steps) + 1) * drives.dt <= p.prediction + 1e-9
        meets = (gap < p.moving_margin) & predicted
        nearness = np.clip(1.0 - gap[:, predicted] / np.float32(p.moving_distance), 0.0, 1.0).mean(axis=1)
        return meets, nearness.astype(np.float32)
