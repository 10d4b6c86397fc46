"""Datasets of any arm, from images on disk: what is found, and what is said where something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration
from bestman_bt.runtime.calibration.dataset import load_dataset
from bestman_bt.runtime.calibration.solve import plot_residuals, solve_hand_eye, solve_head, solve_intrinsics
from tests.perception.calibration.recorded import errors
from tests.runtime.calibration.conftest import HAND_FROM_EYE, written_pose

Write = Callable[..., Path]


def silent(*_: Any) -> None:
    pass


def found_pose(part: dict[str, Any]) -> Pose:
    return Pose.from_xyz_rpy(part["xyz"], part["rpy"])


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("setup", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("method", ["park_martin", "daniilidis"])
def test_a_camera_is_found_from_images_and_poses_of_any_arm(dataset: Write, setup: str, method: str) -> None:
    result = solve_hand_eye(load_dataset(dataset(setup)), method, silent)
    millimetres, degrees = errors(found_pose(result.parts["my_camera"]), HAND_FROM_EYE)
    assert millimetres < 0.5
    assert degrees < 0.1
    assert result.error < 0.2
    assert len(result.views) == 8


@pytest.mark.slow
def test_the_document_is_plain_and_equal_for_equal_data(dataset: Write, tmp_path: Path) -> None:
    folder = dataset()
    files = [tmp_path / "first.yaml", tmp_path / "second.yaml"]
    for file in files:
        solve_hand_eye(load_dataset(folder), "park_martin", silent).write(file)
    assert files[0].read_bytes() == files[1].read_bytes()
    document = yaml.safe_load(files[0].read_text())
    assert document["parts"].keys() == {"my_camera"}
    assert np.shape(document["covariance"]) == (6, 6)
    assert document["reprojection_px"]["rms"] < 0.2
    assert document["views"] == {"recorded": 8, "used": 8}


@pytest.mark.slow
def test_the_picture_of_the_residuals_is_drawn(dataset: Write, tmp_path: Path) -> None:
    plot_residuals(solve_hand_eye(load_dataset(dataset()), "park_martin", silent), tmp_path / "residuals.png")
    picture = cv2.imread(str(tmp_path / "residuals.png"))
    assert picture.shape[:2] == (484, 1100)
    assert 0.5 < (picture == 255).mean() < 0.98


@pytest.mark.slow
def test_views_without_the_board_are_noted(dataset: Write) -> None:
    folder = dataset()
    cv2.imwrite(str(folder / "3.png"), np.full((480, 640, 3), 90, np.uint8))
    result = solve_hand_eye(load_dataset(folder), "park_martin", silent)
    assert result.notes == ("1 of 8 views do not show enough of the board",)
    assert "3" not in result.views


@pytest.mark.slow
def test_one_view_with_the_pose_of_another_is_left_out_and_named(dataset: Write) -> None:
    folder = dataset()

    def swap(document: dict[str, Any]) -> None:
        document["views"][5]["hand"] = document["views"][2]["hand"]

    result = solve_hand_eye(load_dataset(changed(folder, swap)), "park_martin", silent)
    millimetres, degrees = errors(found_pose(result.parts["my_camera"]), HAND_FROM_EYE)
    assert millimetres < 0.5
    assert degrees < 0.1
    assert result.notes[0].startswith("left out because they contradict the other views: 5;")
    assert len(result.views) == 7


def changed(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    file = folder / "dataset.yaml"
    document = yaml.safe_load(file.read_text())
    change(document)
    file.write_text(yaml.safe_dump(document))
    return folder


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["views"][2].update(image="none.png"), r"dataset.yaml:\d+: views\[2\].image: no such file"),
        (lambda d: d["views"][1]["hand"].pop("quaternion"), r"views\[1\].hand: either 'rpy' or 'quaternion'"),
        (lambda d: d["views"][1]["hand"].update(xyz=[0, "1 kg", 0]), r"views\[1\].hand.xyz\[1\]: expected a length"),
        (lambda d: d["board"].pop("marker"), r"board: 'marker' is missing"),
        (lambda d: d["board"].update(marker="40 mm"), r"board: .*markers smaller than them"),
        (lambda d: d["board"].update(kind="circles"), r"board.kind: should be 'charuco' or 'checkerboard'"),
        (lambda d: d.update(bord={}), r"bord: unknown field; did you mean 'board'"),
        (lambda d: d.update(board_on="hand"), r"board_on: names a link, and 'robot' is missing"),
        (lambda d: d.update(views=[]), "views: holds no views"),
    ],
)
def test_a_wrong_dataset_is_reported_with_file_line_and_field(dataset: Write, change, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load_dataset(changed(dataset(), change))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["views"][4].pop("hand"), r"views\[4\]: 'hand' is missing"),
        (lambda d: d.pop("intrinsics"), "intrinsics: is missing: without a robot"),
        (lambda d: d.update(robot="diff_panda", camera="wrist"), "has no camera 'wrist'"),
        (
            lambda d: d.update(robot="diff_panda", camera="wrist_camera"),
            r"views\[0\].joints: positions of panda_joint1, panda_joint2",
        ),
    ],
)
def test_what_a_hand_eye_calibration_lacks_is_reported(dataset: Write, change, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        solve_hand_eye(load_dataset(changed(dataset(), change)), "park_martin", silent)


def test_images_that_are_none_or_of_other_sizes_are_reported_all_at_once(dataset: Write) -> None:
    folder = dataset()
    (folder / "1.png").write_text("no image")
    cv2.imwrite(str(folder / "2.png"), np.zeros((10, 20, 3), np.uint8))
    with pytest.raises(ConfigurationError) as error:
        solve_hand_eye(load_dataset(folder), "park_martin", silent)
    assert "1.png is not an image" in str(error.value)
    assert "2.png has 20 × 10 pixels, the first image 640 × 480" in str(error.value)


def test_a_hand_that_never_turns_is_refused(dataset: Write) -> None:
    def stand_still(document: dict[str, Any]) -> None:
        for index, view in enumerate(document["views"]):
            view["hand"] = written_pose(Pose(np.array([0.01 * index, 0.0, 0.5])))

    with pytest.raises(DegenerateMotionError, match="not parallel"):
        solve_hand_eye(load_dataset(changed(dataset(), stand_still)), "park_martin", silent)


def test_a_checkerboard_is_refused_for_poses(dataset: Write) -> None:
    folder = changed(dataset(), lambda d: d["board"].update(kind="checkerboard"))
    with pytest.raises(CalibrationError, match="half a turn"):
        solve_hand_eye(load_dataset(folder), "park_martin", silent)


def test_a_camera_without_a_head_is_no_head_camera(dataset: Write) -> None:
    with pytest.raises(ConfigurationError, match="this camera is not on a pan-tilt head"):
        solve_head(load_dataset(dataset()), silent)


@pytest.mark.slow
def test_eight_views_in_the_middle_do_not_make_a_lens(dataset: Write) -> None:
    with pytest.raises(CalibrationError, match=r"cover \d+% of the image"):
        solve_intrinsics(load_dataset(dataset()), IntrinsicsCalibration(), silent)
    rough = solve_intrinsics(load_dataset(dataset()), IntrinsicsCalibration(lens="none", min_coverage=0.1), silent)
    assert rough.parts["my_camera"]["set"]["focal_length"][0] == pytest.approx(433.0, abs=8.0)
    assert rough.parts["my_camera"]["set"]["distortion"] == []
