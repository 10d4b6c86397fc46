"""What holds for each path follower, on any path in a hall without walls near it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.messages import Path2D, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.local_planning.mppi import MPPI
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.properties.profile import examples
from tests.robot_models import base_model

DT = 0.05
FOOTPRINT = Footprint(np.array([(0.25, 0.2), (-0.25, 0.2), (-0.25, -0.2), (0.25, -0.2)]))
BACK_NEAR_ITSELF = {
    "hairpin": [(1, 1), (6, 1), (6, 2), (1, 2)],
    "loop": [(1, 1), (4, 1), (4, 4), (1, 4), (1, 1)],
    "out and back": [(1, 1), (3, 1), (1, 1)],
}


def hall(corners):
    low, high = np.min(corners, axis=0) - 3.0, np.max(corners, axis=0) + 3.0
    a, b, c, d = (low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])
    walls = np.array([(*a, *b), (*b, *c), (*c, *d), (*d, *a)])
    return Costmap.from_map(SemanticMap(walls, {}), FOOTPRINT)


def moved(corners, turn, shift):
    cos, sin = math.cos(turn), math.sin(turn)
    return np.asarray(corners, dtype=float) @ np.array([[cos, sin], [-sin, cos]]) + shift


def path_along(corners):
    corners = np.asarray(corners, dtype=float)
    return Path2D(corners, Pose2D(*corners[-1], math.atan2(*(corners[-1] - corners[-2])[::-1])))


def followed(follower, corners, seconds, velocity=(0.0, 0.0)):
    """Places (N, 2), commands (N, 3) and whether the end was reached; a base without any lag."""
    path = path_along(corners)
    follower.configure(base_model(FOOTPRINT.corners))
    follower.reset(path, hall(corners))
    ahead = path.points[1] - path.points[0]
    pose, twist = Pose2D(*path.points[0], math.atan2(ahead[1], ahead[0])), Twist2D(velocity[0], 0.0, velocity[1])
    places, commands = [], [(twist.vx, twist.vy, twist.wz)]
    for _ in range(int(seconds / DT)):
        command = follower.compute(pose, twist, DT)
        twist = command.twist
        commands.append((twist.vx, twist.vy, twist.wz))
        pose = pose @ Pose2D(twist.vx * DT, twist.vy * DT, twist.wz * DT)
        places.append((pose.x, pose.y))
        if command.done:
            return np.array(places), np.array(commands), True
    return np.array(places), np.array(commands), False


def beside(corners, places):
    """For points every 5 cm along the corners, how near the base came."""
    corners = np.asarray(corners, dtype=float)
    along = np.vstack([a + np.linspace(0, 1, 21)[:, None] * (b - a) for a, b in itertools.pairwise(corners)])
    return np.linalg.norm(along[:, None] - places[None, ::4], axis=2).min(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", BACK_NEAR_ITSELF)
@pytest.mark.parametrize("follower", [PurePursuit, DWA, MPPI])
@examples(1)
@given(turn=st.floats(-3.1, 3.1), x=st.floats(-20, 20), y=st.floats(-20, 20))
def test_a_path_that_comes_back_near_itself_is_driven_to_its_end(follower, name, turn, x, y):
    corners = moved(BACK_NEAR_ITSELF[name], turn, (x, y))
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    places, _, done = followed(follower(), corners, 20.0 + 4.0 * length)
    assert done
    assert np.linalg.norm(places[-1] - corners[-1]) < 0.02
    # Corners may be cut, and a strand driven beside, but not left out.
    assert beside(corners, places).max() < 1.2
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() > 0.7 * length


strands = st.lists(st.tuples(st.floats(0.3, 3.0), st.floats(-3.1, 3.1)), min_size=1, max_size=5)


@examples(30)
@given(strands, st.floats(-0.6, 0.6), st.floats(-1.2, 1.2), st.floats(-math.pi, math.pi))
def test_pure_pursuit_keeps_its_acceleration_whatever_the_base_was_doing_when_the_path_came(way, vx, wz, turned):
    headings = np.cumsum([turn for _, turn in way]) + turned
    steps = [length * np.array([math.cos(h), math.sin(h)]) for (length, _), h in zip(way, headings, strict=True)]
    corners = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    follower = PurePursuit()
    follower.reset(path_along(corners))
    pose, twist = Pose2D(), Twist2D(vx, 0.0, wz)
    for _ in range(int(4.0 / DT)):
        command = follower.compute(pose, twist, DT)
        change = abs(command.twist.vx - twist.vx), abs(command.twist.wz - twist.wz)
        assert change[0] <= 2.0 * follower.acceleration * DT + 1e-9
        assert change[1] <= follower.turn_acceleration * DT + 1e-9
        twist = command.twist
        pose = pose @ Pose2D(twist.vx * DT, 0.0, twist.wz * DT)


@examples(30)
@given(st.floats(0.02, 0.5), st.floats(0.5, 4.0), st.floats(-0.1, 0.1))
def test_pure_pursuit_counts_no_progress_on_a_strand_that_is_close_by(apart, length, off):
    """Standing at the end of the first strand's first metre, or anywhere before, is not having driven the second."""
    turn = np.linspace(-math.pi / 2, math.pi / 2, 13)
    bend = np.column_stack([length + apart / 2 * np.cos(turn), apart / 2 + apart / 2 * np.sin(turn)])
    corners = np.vstack([[(0.0, 0.0)], bend, [(0.0, apart)]])
    total = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    follower = PurePursuit()
    follower.reset(path_along(corners))
    for x in np.arange(0.0, length - 0.02, 0.02):
        driven = total - follower.compute(Pose2D(x, off, 0.0), Twist2D(0.3, 0.0, 0.0), DT).remaining
        assert driven == pytest.approx(x, abs=0.15)
