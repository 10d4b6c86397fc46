"""What joints refuse: each limit on both sides, of each joint, told by its name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import JointTrajectory
from hal.api import CommandRefusedError
from hal.parts.streamed_joints import JointCommandChecks
from tests.robot_models import joint_group_model

NAMES = ("pan", "tilt")
CHECKS = JointCommandChecks(
    "head",
    joint_group_model(NAMES, lower=(-2.0, -1.0), upper=(1.0, 0.5), velocity=(1.0, 2.0), effort=(10.0, 5.0)),
)
LIMITS = {
    "positions": ((-2.0, -1.0), (1.0, 0.5)),
    "velocities": ((-1.0, -2.0), (1.0, 2.0)),
    "efforts": ((-10, -5), (10, 5)),
}
TIMES, WAY = [0.0, 0.5, 1.0], [[0.0, 0.0], [0.3, 0.2], [0.4, 0.4]]


@pytest.mark.parametrize("kind", list(LIMITS))
def test_a_set_point_may_be_at_a_limit_and_not_beyond_it(kind: str) -> None:
    check = getattr(CHECKS, kind)
    for limit, out in zip(LIMITS[kind], (-1.0, 1.0), strict=True):
        assert check("command", limit) == pytest.approx(limit, abs=0.0)
        assert check("command", np.add(limit, out * 5e-7)) == pytest.approx(limit, abs=0.0), "rounding is cut off"
        for joint, name in enumerate(NAMES):
            beyond = np.array(limit, dtype=float)
            beyond[joint] += out * 1e-5
            with pytest.raises(CommandRefusedError, match=f"head refused command: {kind} of {name} = "):
                check("command", beyond)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([0.0, math.nan], "should be finite"),
        ([math.inf, 0.0], "should be finite"),
        ([0.0], r"should have shape \(2,\)"),
        (0.0, r"should have shape \(2,\)"),
        (["far", 0.0], "are not numbers"),
        (None, "should have shape"),
    ],
)
def test_what_is_no_set_point_of_these_joints_is_refused(values: Any, why: str) -> None:
    with pytest.raises(CommandRefusedError, match=f"head refused command: positions {why}"):
        CHECKS.positions("command", values)


@pytest.mark.parametrize("scale", [0.0, -0.1, 1.001, math.nan])
def test_a_share_of_the_speed_is_above_0_and_at_most_1(scale: float) -> None:
    assert CHECKS.speed_scale("move_to", 1.0) == 1.0
    assert CHECKS.speed_scale("move_to", 1e-3) == 1e-3
    with pytest.raises(CommandRefusedError, match="speed_scale"):
        CHECKS.speed_scale("move_to", scale)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_streamed_set_point_is_near_enough_for_the_speed_of_each_joint(sign: float) -> None:
    here = np.array([-1.0, 0.2])
    CHECKS.servo(here + sign * 0.1 * np.array([1.01, 2.02]), here, 0.1)
    for step, name in (((1.03, 0.0), "pan"), ((0.0, 2.06), "tilt"), ((1.03, 1.9), "pan")):
        with pytest.raises(CommandRefusedError, match=f"head refused servo: {name} would need"):
            CHECKS.servo(here + sign * 0.1 * np.array(step), here, 0.1)


def follow(
    way: list[list[float]] = WAY,
    velocity: tuple[float, float] = (0.0, 0.0),
    measured: tuple[float, float] = (0.0, 0.0),
    times: list[float] = TIMES,
    names: tuple[str, ...] = NAMES,
) -> None:
    speeds = np.zeros_like(way)
    speeds[-1] = velocity
    CHECKS.trajectory(JointTrajectory(names, np.array(times), np.array(way), speeds), np.array(measured))


def test_a_trajectory_within_the_limits_that_starts_nearby_is_taken() -> None:
    follow(velocity=(1.01, -2.02), measured=(0.049, -0.049))
    follow(way=[[0.0, 0.0], [0.505, -1.0], [0.0, 0.0]])
    follow(way=[[0.0, 0.0]], times=[0.0])


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"names": ("tilt", "pan")}, "the joints are"),
        ({"way": [*WAY[:2], [0.4, 0.51]]}, "position of tilt in sample 2"),
        ({"way": [[0.0, 0.0], [-0.4, -1.01], [0.0, 0.0]]}, "position of tilt in sample 1"),
        ({"velocity": (1.03, 0.0)}, "velocity of pan in sample 2"),
        ({"velocity": (0.0, -2.05)}, "velocity of tilt in sample 2"),
        ({"way": [[0.0, 0.0], [0.52, 0.0], [0.5, 0.0]]}, "velocity of pan in sample 0"),
        ({"way": [[0.0, 0.0], [-0.4, 0.0], [-0.95, 0.0]]}, "velocity of pan in sample 1"),
        ({"measured": (0.051, 0.0)}, "starts with pan"),
        ({"measured": (0.01, -0.051)}, "starts with tilt"),
    ],
)
def test_a_trajectory_is_refused_with_the_joint_and_sample_that_is_wrong(change: dict[str, Any], why: str) -> None:
    with pytest.raises(CommandRefusedError, match=f"head refused follow: .*{why}"):
        follow(**change)


def test_exactly_one_kind_of_set_point_is_given() -> None:
    CHECKS.one_kind("command", None, [0.0, 0.0], None)
    for kinds in ((None, None, None), ([0.0], None, [0.0])):
        with pytest.raises(CommandRefusedError, match="exactly one"):
            CHECKS.one_kind("command", *kinds)
