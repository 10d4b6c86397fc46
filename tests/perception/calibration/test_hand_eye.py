"""Where a camera sits on its hand: both closed forms, the refinement, its covariance, and motions that do not tell."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye import Daniilidis, ParkMartin, relative_motions
from tests.perception.calibration.recorded import Recording, errors, hand_eye_recording, turned

METHODS = (ParkMartin, Daniilidis)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("refine", [False, True])
def test_without_noise_the_camera_is_found_exactly(method, refine):
    for seed in range(10):
        truth = hand_eye_recording(seed, views=5, position=0.0, rotation=0.0)
        found = method(refine=refine).eye_in_hand(truth.world_from_carrier, truth.eye_from_target)
        assert errors(found.carrier_from_eye, truth.carrier_from_eye) == pytest.approx((0.0, 0.0), abs=1e-5)
        assert errors(found.world_from_target, truth.world_from_target) == pytest.approx((0.0, 0.0), abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_with_noise_the_camera_is_found_to_a_millimetre_and_a_tenth_of_a_degree(method):
    found = []
    for seed in range(40):
        truth = hand_eye_recording(seed)
        result = method().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)
        found.append(errors(result.carrier_from_eye, truth.carrier_from_eye))
    millimetres, degrees = np.percentile(found, 95, axis=0)
    assert millimetres < 1.0
    assert degrees < 0.1


@pytest.mark.slow
def test_the_refinement_is_better_than_either_closed_form():
    recordings = [hand_eye_recording(seed) for seed in range(40)]

    def mean_error(refine: bool) -> float:
        method = Daniilidis(refine=refine)
        found = [method.eye_in_hand(r.world_from_carrier, r.eye_from_target).carrier_from_eye for r in recordings]
        return float(np.mean([errors(pose, r.carrier_from_eye)[0] for pose, r in zip(found, recordings, strict=True)]))

    assert mean_error(refine=True) < 0.97 * mean_error(refine=False)


@pytest.mark.slow
def test_the_covariance_reports_how_wrong_the_result_is():
    """The squared error, weighed by the stated covariance, has mean 6: the number of unknowns."""
    weighed = []
    for seed in range(60):
        truth = hand_eye_recording(seed)
        result = ParkMartin().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)
        found = result.carrier_from_eye
        turn = Rotation.from_quat(found.quaternion) * Rotation.from_quat(truth.carrier_from_eye.quaternion).inv()
        error = np.append(found.position - truth.carrier_from_eye.position, turn.as_rotvec())
        weighed.append(error @ np.linalg.solve(result.covariance, error))
    assert 4.5 < np.mean(weighed) < 8.0


@pytest.mark.parametrize("method", METHODS)
def test_a_camera_beside_the_robot_is_found_as_well(method):
    truth = hand_eye_recording(3)
    # The same motions, told the other way round: what carried the eye is now the base, the world is the hand.
    base_from_hand = [pose.inverse() for pose in truth.world_from_carrier]
    found = method().eye_to_hand(base_from_hand, truth.eye_from_target)
    millimetres, degrees = errors(found.carrier_from_eye, truth.carrier_from_eye)
    assert millimetres < 1.5
    assert degrees < 0.15


def about_one_axis(truth: Recording, axis: np.ndarray) -> Recording:
    """Views that differ by turns about one axis of the world, and by shifts."""
    rng = np.random.default_rng(5)
    base_from_hand = [
        Pose(rng.uniform(-0.2, 0.2, 3)) @ turned(angle * axis) @ truth.world_from_carrier[0]
        for angle in np.linspace(-0.6, 0.6, 15)
    ]
    seen = [(pose @ truth.carrier_from_eye).inverse() @ truth.world_from_target for pose in base_from_hand]
    return Recording(truth.carrier_from_eye, truth.world_from_target, base_from_hand, seen)


@pytest.mark.parametrize("method", METHODS)
def test_motions_about_one_axis_are_refused_in_words(method):
    truth = about_one_axis(hand_eye_recording(1), np.array([0.0, 0.6, 0.8]))
    with pytest.raises(
        DegenerateMotionError, match=r"turn by \d+\.\d° about one axis but only by 0\.0° about any other"
    ):
        method().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)


@pytest.mark.parametrize("method", METHODS)
def test_motions_without_turns_are_refused(method):
    truth = about_one_axis(hand_eye_recording(1), np.zeros(3))
    with pytest.raises(DegenerateMotionError, match="not parallel"):
        method().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)


@pytest.mark.parametrize(("degrees", "used"), [(169.0, 1), (171.0, 0), (-171.0, 0), (189.0, 0), (191.0, 1)])
def test_motions_near_half_a_turn_are_not_used(degrees: float, used: int):
    """There the axis may as well point the other way; it counts for the carrier and for the camera."""
    still, turn = Pose(), turned(np.radians(degrees) * np.array([0.6, 0.0, 0.8]))
    for carriers, seen in (([still, turn], [still, still]), ([still, still], [still, turn])):
        motions = relative_motions(carriers, seen)
        assert len(motions.carrier) == len(motions.eye) == used


def test_motions_are_those_of_the_camera_on_its_carrier():
    truth = hand_eye_recording(1, views=4, position=0.0, rotation=0.0)
    motions = relative_motions(truth.world_from_carrier, truth.eye_from_target)
    x = truth.carrier_from_eye.matrix
    assert 0 < len(motions.carrier) <= 6
    assert motions.carrier @ x == pytest.approx(x @ motions.eye, abs=1e-9)


def test_poses_and_images_in_different_orders_are_refused():
    truth = hand_eye_recording(2)
    with pytest.raises(CalibrationError, match="do not belong together"):
        ParkMartin().eye_in_hand(truth.world_from_carrier, truth.eye_from_target[::-1])


def test_too_few_views_are_refused():
    truth = hand_eye_recording(2, views=3)
    with pytest.raises(CalibrationError, match="at least 4 views are needed, got 3"):
        ParkMartin().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)
    with pytest.raises(CalibrationError, match="poses and views should be equal"):
        ParkMartin().eye_in_hand(truth.world_from_carrier, truth.eye_from_target[:2])


def test_residuals_are_those_of_the_noise():
    truth = hand_eye_recording(4, views=30)
    result = ParkMartin().eye_in_hand(truth.world_from_carrier, truth.eye_from_target)
    assert 0.0003 < np.sqrt(np.mean(result.position_residuals**2)) < 0.0015
    assert math.radians(0.05) < np.sqrt(np.mean(result.rotation_residuals**2)) < math.radians(0.2)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("wrong", [(3,), (0, 7, 9)])
def test_views_that_contradict_the_others_are_left_out_and_named(method, wrong):
    truth = hand_eye_recording(6, views=10)
    hands = list(truth.world_from_carrier)
    for number, view in enumerate(wrong):
        hands[view] = hands[view] @ Pose(np.array([0.03, 0.01 * number, -0.02])) @ turned(np.array([0.3, 0.2, number]))
    found = method().eye_in_hand(hands, truth.eye_from_target)
    millimetres, degrees = errors(found.carrier_from_eye, truth.carrier_from_eye)
    assert found.rejected == wrong
    assert millimetres < 1.5
    assert degrees < 0.2
    assert min(found.position_residuals[list(wrong)]) > 5.0 * np.median(found.position_residuals)


def test_views_many_of_which_contradict_the_others_are_refused():
    truth = hand_eye_recording(6, views=10)
    hands = [
        pose @ Pose(np.array([0.01 * view, 0.03, 0.0])) if view in (1, 4, 6, 9) else pose
        for view, pose in enumerate(truth.world_from_carrier)
    ]
    with pytest.raises(CalibrationError, match=r"4 of 10 views contradict the others: 1, 4, 6, 9; .*record them again"):
        ParkMartin().eye_in_hand(hands, truth.eye_from_target)
