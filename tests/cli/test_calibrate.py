"""bestman-bt calibrate: a simulated robot that is not built as its file says, and the verb's answers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import CameraPart
from tests.cli.command_line import Answer

pytestmark = pytest.mark.slow

Command = Callable[..., Answer]


def test_a_wrist_camera_is_calibrated_from_pixels_and_the_file_fits_the_robot(
    bestman_bt: Command, folder: Path
) -> None:
    options = ("--simulate", "diff_panda", "--views", 7, "--seed", 3, "--out", "here", "--json")
    answer = bestman_bt("calibrate", "hand-eye", *options)
    assert answer.code == 0
    truth = answer.document["against_the_truth"]
    assert truth["position_mm"] < 1.0 < truth["position_mm_before"]
    assert truth["rotation_deg"] < 0.1 < truth["rotation_deg_before"]
    assert (folder / "here" / "residuals.png").stat().st_size > 10_000
    found = load_robot_model("diff_panda", {"calibration": ["here/calibration.yaml"]})
    assert (
        found.of(CameraPart)["wrist_camera"].depth_scale
        == answer.document["parts"]["wrist_camera"]["set"]["depth_scale"]
    )
    # The recorded views are a dataset like any other, and give the same file again.
    first = (folder / "here" / "calibration.yaml").read_bytes()
    again = bestman_bt("calibrate", "hand-eye", "here", "--method", "park_martin")
    assert again.code == 0
    assert "wrist_camera: 7 of 7 views" in again.out
    assert "--set robot.calibration=[here/calibration.yaml]" in again.out
    assert (folder / "here" / "calibration.yaml").read_bytes() == first


def test_a_head_is_calibrated_with_a_board_in_the_hand(bestman_bt: Command) -> None:
    options = ("--simulate", "diff_panda", "--views", 9, "--seed", 4, "--json")
    answer = bestman_bt("calibrate", "head", *options)
    assert answer.code == 0
    truth = answer.document["against_the_truth"]
    assert truth["position_mm"] < 2.5 < truth["position_mm_before"]
    assert truth["rotation_deg"] < 0.2 < truth["rotation_deg_before"]
    assert answer.document["estimated"] == ["mount", "camera", "board"]
    assert answer.document["file"] == "calibration-head-4/calibration.yaml"


def test_wrong_input_is_reported_before_anything_starts(bestman_bt: Command) -> None:
    for arguments, words in (
        (("hand-eye",), "give a dataset, or --simulate ROBOT"),
        (("hand-eye", "views", "--simulate", "diff_panda"), "and not both"),
        (("hand-eye", "nowhere"), "nowhere/dataset.yaml"),
        (("hand-eye", "--simulate", "dif_panda"), "did you mean 'diff_panda'"),
        (("hand-eye", "--simulate", "diff_panda", "--camera", "wrist"), "no camera 'wrist'"),
        (("head", "--simulate", "diff_panda", "--camera", "wrist_camera"), "moves camera 'wrist_camera'"),
        (("hand-eye", "--simulate", "diff_panda", "--set", "time_limit=3"), "only settings of the robot"),
    ):
        answer = bestman_bt("calibrate", *arguments)
        assert answer.code == 2, arguments
        assert words in answer.err
