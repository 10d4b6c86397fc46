"""Where the base may stand while the arm moves a door or drawer, and from where the arm follows it all the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.leaf import Leaf, Touching, free_along
from bestman_bt.manipulation.kinematics import (
    StandAlong,
    StandAlongParameters,
    Stations,
    body_between,
    rank_stand_poses_along,
)
from bestman_bt.messages import Box, Pose2D

BASE_GAP = 0.05
"""Metres that the robot's body keeps from where the leaf passes."""
SAME_STAND = 0.05
STANDS = StandAlongParameters(enough=2, most=24, starts=3)
ACROSS = np.linspace(-0.5, 0.5, 9)
"""Places on a front, as shares of its width, that stand for all of it."""


def room_beside(skills: SkillContext, leaf: Leaf, positions: Sequence[float]) -> Callable[[Pose2D], bool]:
    """Whether the base has room at a stand (map frame) and its body is where the leaf does not pass at ``positions``.

    Body and head may be below or above the leaf; the arm is not looked at.
    """
    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    height, thickness = front.shape.size[2], front.shape.size[0]
    low = float(front.pose.position[2]) - height / 2
    body = body_between(skills.robot, skills.joints.positions(), skills.arm.name, low - BASE_GAP, low + height)
    swept = swept_by(leaf, positions)
    clearance = skills.costmap().clearance_at

    def is_free(stand: Pose2D) -> bool:
        if clearance(stand) <= 0.0:
            return False
        if body is None:
            return True
        local = stand.inverse().apply(swept)
        gap = BASE_GAP + thickness / 2
        return not bool(((local > body[0] - gap) & (local < body[1] + gap)).all(axis=1).any())

    return is_free


def swept_by(leaf: Leaf, positions: Sequence[float]) -> NDArray[np.float64]:
    """Points (N, 2) of the map over which the front passes."""
    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    across = np.column_stack([np.zeros(len(ACROSS)), ACROSS * front.shape.size[1], np.zeros(len(ACROSS))])
    return np.concatenate([leaf.front(position).apply(across)[:, :2] for position in positions])


def stands_along_leaf(
    skills: SkillContext,
    leaf: Leaf,
    candidates: Sequence[Pose2D],
    stations: Stations,
    positions: Sequence[float],
    touching: Touching,
    skip: int = 0,
    parameters: StandAlongParameters = STANDS,
) -> tuple[StandAlong, ...]:
    """Stands, best first, from which the arm follows all ``stations`` (map frame) while the leaf is at ``positions``.

    ``touching``, ``skip``: as in ``free_along``.
    """
    return rank_stand_poses_along(
        candidates,
        stations,
        skills.algorithms.kinematics,
        skills.arm_model,
        skills.arm_positions(),
        skills.rng,
        is_free_at=lambda stand: free_along(skills, leaf, positions, touching, stand, skip),
        current=skills.world.base.pose,
        parameters=parameters,
    )
