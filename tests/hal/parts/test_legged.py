"""Leg kinematics, attitude, gait: pure parts of the walking base."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel, LeggedBaseModel
from bestman_bt.robot_model.payload import payload
from hal.parts.legged.trot import LegKinematics, Trot
from hal.parts.legged.walker import Attitude, LegOdometry, TrotGait

HEIGHT, PERIOD = 0.27, 1 / 240


@pytest.fixture(scope="module")
def kinematics() -> LegKinematics:
    return LegKinematics(load_robot_model("a1").of(LeggedBaseModel)["base"])


def test_inverse_kinematics_undoes_forward_kinematics(kinematics: LegKinematics) -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        angles = rng.uniform([-0.5, 0.2, -2.2], [0.5, 1.4, -1.0], (4, 3))
        assert kinematics.angles(kinematics.feet(angles)) == pytest.approx(angles, abs=1e-9)


def test_the_feet_stand_around_the_centre_of_mass_in_the_home_posture_of_a1(kinematics: LegKinematics) -> None:
    model = load_robot_model("a1")
    home = model.posture("home", model.of(BaseModel)["base"].part.joints).reshape(4, 3)
    below = kinematics.below_hips(HEIGHT)
    below[:, :2] += payload(model, "trunk", model.postures["home"]).centre[:2]
    assert kinematics.feet(home) == pytest.approx(below, abs=1e-3)


def test_jacobians_are_the_derivatives_of_the_feet(kinematics: LegKinematics) -> None:
    angles = np.random.default_rng(1).uniform([-0.5, 0.2, -2.2], [0.5, 1.4, -1.0], (4, 3))
    jacobians = kinematics.jacobians(angles)
    for joint in range(3):
        step = np.zeros((4, 3))
        step[:, joint] = 1e-6
        slope = (kinematics.feet(angles + step) - kinematics.feet(angles - step)) / 2e-6
        assert jacobians[:, :, joint] == pytest.approx(slope, abs=1e-8)


def test_feet_out_of_reach_are_taken_back(kinematics: LegKinematics) -> None:
    assert np.all(np.isfinite(kinematics.angles(kinematics.below_hips(1.0))))


def test_attitude_turns_with_the_gyroscope_and_gravity_sets_it_upright() -> None:
    attitude = Attitude()
    for _ in range(240):
        attitude.update(np.array([0.0, 0.0, 0.7]), np.array([0.0, 0.0, 9.81]), PERIOD, standing=False)
    assert attitude.heading == pytest.approx(0.7, abs=1e-6)
    tilted = np.array([-math.sin(0.2), 0.0, math.cos(0.2)]) * 9.81  # pitched down by 0.2 rad
    for _ in range(15 * 240):
        attitude.update(np.zeros(3), tilted, PERIOD, standing=False)
    gravity_felt = attitude.level_from_trunk.T @ [0.0, 0.0, 9.81]
    assert gravity_felt == pytest.approx(tilted, abs=0.05)


@pytest.mark.slow
def test_attitude_learns_the_bias_while_it_stands() -> None:
    attitude, bias = Attitude(), np.array([0.01, -0.02, 0.015])
    for _ in range(20 * 240):  # ten times as long as it takes to learn most of it
        attitude.update(bias, np.array([0.0, 0.0, 9.81]), PERIOD, standing=True)
    before = attitude.heading
    for _ in range(10 * 240):
        attitude.update(bias, np.array([0.0, 0.0, 9.81]), PERIOD, standing=False)
    assert attitude.heading == pytest.approx(before, abs=1e-3)


def test_odometry_goes_where_the_heading_points() -> None:
    odometry = LegOdometry()
    for _ in range(240):
        odometry.update(np.array([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0]]), math.pi / 2, PERIOD, smoothing=0.05)
    assert (odometry.x, odometry.y, odometry.travelled) == pytest.approx((0.0, 0.4, 0.4))


@pytest.fixture
def trot(kinematics: LegKinematics) -> Trot:
    return Trot(kinematics.below_hips(HEIGHT))


def test_diagonal_legs_swing_together_and_two_feet_always_stand(trot: Trot) -> None:
    swung = set()
    for _ in range(480):
        trot.update(np.array([0.3, 0.0, 0.0]), np.array([0.3, 0.0]), PERIOD)
        assert trot.stance[0] == trot.stance[3]
        assert trot.stance[1] == trot.stance[2]
        assert trot.stance.sum() >= 2
        swung |= set(np.flatnonzero(~trot.stance).tolist())
        assert np.abs(trot.feet[trot.stance, 2] + HEIGHT).max() < 1e-9
    assert swung == {0, 1, 2, 3}


def test_feet_on_the_floor_move_as_the_velocity_says(trot: Trot) -> None:
    command = np.array([0.2, 0.1, 0.5])
    for _ in range(200):
        before, stood = trot.feet.copy(), trot.stance.copy()
        trot.update(command, command[:2], PERIOD)
        for leg in np.flatnonzero(stood & trot.stance):
            x, y, _ = before[leg]
            moved = (trot.feet[leg] - before[leg])[:2] / PERIOD
            assert moved == pytest.approx([-(0.2 - 0.5 * y), -(0.1 + 0.5 * x)], abs=1e-6)


def test_a_push_sets_the_feet_further_out(trot: Trot) -> None:
    """Pushed to the left at 0.3 m/s while it should stand on the spot, it steps to the left."""
    trot.update(np.array([0.0, 0.0, 0.01]), np.zeros(2), PERIOD)
    middle = trot.feet[:, 1].mean()
    for _ in range(72):
        trot.update(np.array([0.0, 0.0, 0.01]), np.array([0.0, 0.3]), PERIOD)
    assert trot.feet[:, 1].mean() > middle + 0.01


def test_it_stands_on_all_feet_again_soon_after_the_last_command(trot: Trot) -> None:
    for _ in range(100):
        trot.update(np.array([0.3, 0.0, 0.0]), np.zeros(2), PERIOD)
    steps = 0
    while trot.walking:
        trot.update(np.zeros(3), np.zeros(2), PERIOD)
        steps += 1
    assert trot.stance.all()
    assert steps * PERIOD < 0.35


@pytest.fixture
def gait() -> TrotGait:
    model = load_robot_model("a1")
    return TrotGait(model.of(LeggedBaseModel)["base"], payload(model, "trunk", model.postures["home"]))


def torques(gait: TrotGait, command: tuple[float, float, float], times: int, off: float = 0.0) -> np.ndarray:
    """The joint torques (4, 3) after ``times`` periods of readings at home, upright, thighs ``off`` radians away."""
    angles = gait.kinematics.angles(gait.kinematics.below_hips(gait.height)) + np.array([0.0, off, 0.0])
    force = np.array([0.0, 0.0, GRAVITY])
    for _ in range(times):
        found = gait.update(np.array(command), angles, np.zeros((4, 3)), np.zeros(3), force, PERIOD)
    return found


def test_standing_legs_carry_the_weight_without_pushing_aside(gait: TrotGait) -> None:
    angles = gait.kinematics.angles(gait.kinematics.below_hips(gait.height))
    jacobians = gait.kinematics.jacobians(angles)
    carried = torques(gait, (0.0, 0.0, 0.0), 1)
    assert gait.wanted_angles is not None
    carried = carried - gait.joint_gain * (gait.wanted_angles - angles)  # of the joints, towards the centre of mass
    forces = np.linalg.solve(jacobians.transpose(0, 2, 1), -carried[:, :, None])[:, :, 0]
    assert forces.sum(axis=0)[2] == pytest.approx(gait.body.mass * GRAVITY, rel=0.2)
    assert (np.linalg.norm(forces[:, :2], axis=1) <= gait.friction * forces[:, 2] + 1e-6).all()


def test_no_joint_of_a_leg_gets_more_than_its_effort(gait: TrotGait) -> None:
    most = np.array(gait.base.part.limits.effort).reshape(4, 3)
    assert np.abs(torques(gait, (0.0, 0.0, 0.0), 1, off=1.0))[:, 1] == pytest.approx(most[:, 1])


@pytest.mark.slow
def test_what_the_legs_lack_of_the_velocity_is_made_up_for_within_bounds_and_forgotten_at_rest(gait: TrotGait) -> None:
    torques(gait, (0.3, 0.0, -0.4), 480)  # legs that do not move
    assert gait.correction[[0, 2]] == pytest.approx([gait.most_correction[0], -gait.most_correction[2]])
    torques(gait, (0.0, 0.0, 0.0), 1)
    assert gait.correction == pytest.approx(np.zeros(3))
