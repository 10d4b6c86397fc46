"""A pan-tilt head is calibrated from corners in pixels: before a fixed board, and with one in the hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.head_camera import BoardView, ChainCalibration, ChainPoses, calibrate_head_camera
from tests.perception.calibration.recorded import CAMERA, LENS, errors, hand_eye_recording, noisy, sighting

MOUNT = Pose(np.array([-0.2, 0.0, 1.6]))
CAMERA_ON_HEAD = Pose.from_xyz_rpy((0.05, 0.0, 0.0), (-math.pi / 2, 0.0, -math.pi / 2))
BOARD = Pose.from_xyz_rpy((0.55, 0.08, 0.95), (0.0, math.radians(-35.0), 0.0)) @ Pose.from_xyz_rpy(
    (0, 0, 0), (math.pi, 0, math.pi / 2)
)


def head(pan: float, tilt: float) -> Pose:
    """mount_from_carrier: pan about z, then 6 cm up tilt about y."""
    return Pose.from_xyz_rpy((0, 0, 0), (0, 0, pan)) @ Pose.from_xyz_rpy((0, 0, 0.06), (0, tilt, 0))


def really(pose: Pose, rng: np.random.Generator) -> Pose:
    """The pose as it is built: up to 1 cm and 2° from the drawing."""
    return noisy(pose, 0.006, math.radians(1.2), rng)


def views_of(mount: Pose, camera: Pose, board: Pose, holders: list[Pose], rng: np.random.Generator, lens=CAMERA):
    views = []
    for holder in holders:
        for _ in range(50):
            carrier = head(rng.uniform(-0.35, 0.45), rng.uniform(0.35, 1.0))
            eye_from_board = (mount @ carrier @ camera).inverse() @ holder @ board
            seen = sighting(eye_from_board, lens, rng, 0.15)
            if len(seen.points) == 24:
                views.append(BoardView(seen, carrier, holder))
                break
    return views


@pytest.mark.slow
def test_a_fixed_board_reports_how_the_camera_sits_on_the_head():
    for seed in range(3):
        rng = np.random.default_rng(seed)
        mount, camera = really(MOUNT, rng), really(CAMERA_ON_HEAD, rng)
        views = views_of(mount, camera, BOARD, [Pose()] * 20, rng)
        result = calibrate_head_camera(views, CAMERA, MOUNT, CAMERA_ON_HEAD)
        assert result.free == ("camera", "board")
        assert result.pan_offset is None
        millimetres, degrees = errors(result.chain.poses.camera, camera)
        assert millimetres < 2.0
        assert degrees < 0.1
        assert 0.15 < np.mean(result.chain.errors) < 0.28


@pytest.mark.slow
def test_a_board_in_the_hand_reports_where_the_head_stands_too():
    rng = np.random.default_rng(5)
    mount, camera, lens = really(MOUNT, rng), really(CAMERA_ON_HEAD, rng), LENS
    on_hand = Pose.from_xyz_rpy((0.0, 0.02, 0.1), (0.1, 0.0, 0.2))
    base_from_board = [noisy(BOARD, 0.08, 0.25, rng) for _ in range(25)]
    hands = [pose @ on_hand.inverse() for pose in base_from_board]
    views = views_of(mount, camera, on_hand, hands, rng, lens)
    result = calibrate_head_camera(views, lens, MOUNT, CAMERA_ON_HEAD)
    assert result.free == ("mount", "camera", "board")
    for found, true in ((result.chain.poses.mount, mount), (result.chain.poses.camera, camera)):
        millimetres, degrees = errors(found, true)
        assert millimetres < 3.0
        assert degrees < 0.2
    # What counts for the robot is where the two together put the camera.
    carrier = head(0.2, 0.7)
    together = errors(result.chain.poses.mount @ carrier @ result.chain.poses.camera, mount @ carrier @ camera)
    assert together[0] < 1.5
    assert together[1] < 0.1
    deviations = np.sqrt(np.diag(result.chain.covariance["camera"]))
    assert (np.abs(result.chain.poses.camera.position - camera.position) < 5 * deviations[:3]).all()


@pytest.mark.parametrize("moved", [None, 1, 2, 5])
def test_a_board_that_any_view_shows_elsewhere_is_held(moved: int | None):
    holders = [Pose()] * 6
    if moved is not None:
        holders[moved] = Pose(np.array([0.02, 0.0, 0.0]))
    rng, views = np.random.default_rng(4), []
    for holder, pan in zip(holders, np.linspace(-0.3, 0.4, 6), strict=True):
        eye_from_board = (MOUNT @ head(pan, 0.6) @ CAMERA_ON_HEAD).inverse() @ holder @ BOARD
        views.append(BoardView(sighting(eye_from_board, CAMERA, rng, 0.0), head(pan, 0.6), holder))
    anything = ChainCalibration(worst_deviation=1e9)
    found = calibrate_head_camera(views, CAMERA, MOUNT, CAMERA_ON_HEAD, chain=anything)
    assert found.free == (("camera", "board") if moved is None else ("mount", "camera", "board"))


@pytest.mark.slow
def test_offsets_of_the_encoders_are_reported():
    rng = np.random.default_rng(6)
    pan, tilt = math.radians(1.5), math.radians(-2.0)
    mount = MOUNT @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, pan))
    camera = Pose.from_xyz_rpy((0, 0, 0), (0, tilt, 0)) @ CAMERA_ON_HEAD
    views = views_of(mount, camera, BOARD, [Pose()] * 20, rng)
    known_board = calibrate_head_camera(views, CAMERA, MOUNT, CAMERA_ON_HEAD, BOARD)
    assert known_board.free == ("mount", "camera")
    assert known_board.pan_offset == pytest.approx(pan, abs=math.radians(0.1))
    assert known_board.tilt_offset == pytest.approx(tilt, abs=math.radians(0.1))


def test_a_head_that_only_pans_does_not_tell_and_the_words_report_what():
    rng = np.random.default_rng(7)
    carriers = [head(pan, 0.6) for pan in np.linspace(-0.25, 0.35, 12)]
    views = [
        BoardView(sighting((MOUNT @ carrier @ CAMERA_ON_HEAD).inverse() @ BOARD, CAMERA, rng), carrier)
        for carrier in carriers
    ]
    with pytest.raises(DegenerateMotionError, match=r"do not determine (camera|board) .*about more than one axis"):
        calibrate_head_camera(views, CAMERA, MOUNT, CAMERA_ON_HEAD)


def test_too_few_views_are_refused():
    with pytest.raises(CalibrationError, match="at least 4 views of the board are needed, got 1"):
        calibrate_head_camera(
            views_of(MOUNT, CAMERA_ON_HEAD, BOARD, [Pose()], np.random.default_rng(0)), CAMERA, MOUNT, CAMERA_ON_HEAD
        )


@pytest.mark.slow
def test_one_wrong_view_does_not_spoil_a_wrist_camera():
    rng = np.random.default_rng(8)
    truth = hand_eye_recording(8, position=0.0, rotation=0.0)
    hands = list(truth.world_from_carrier)
    views = [
        BoardView(sighting(eye, CAMERA, rng, 0.1), hand) for hand, eye in zip(hands, truth.eye_from_target, strict=True)
    ]
    views[3] = BoardView(views[3].sighting, hands[3] @ Pose(np.array([0.03, 0.0, 0.0])))
    start = ChainPoses(Pose(), noisy(truth.carrier_from_eye, 0.01, 0.02, rng), truth.world_from_target)
    result = ChainCalibration().calibrate(views, CAMERA, start, ("camera", "board"))
    trusting = ChainCalibration(outlier=1e6, view_outlier=1e6).calibrate(views, CAMERA, start, ("camera", "board"))
    millimetres, degrees = errors(result.poses.camera, truth.carrier_from_eye)
    assert millimetres < 1.0
    assert degrees < 0.2
    assert millimetres < 0.3 * errors(trusting.poses.camera, truth.carrier_from_eye)[0]
    assert result.rejected == (3,)
    assert len(result.errors) == len(views) - 1
