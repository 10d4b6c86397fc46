"""A recording reads as the robot did, to the bit, and takes the commands that it was given."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.api import (
    Arm,
    Camera,
    CommandRefusedError,
    MobileBase,
    MotionErrorCode,
    MotionStatus,
    NoDataError,
    NotConnectedError,
)
from hal.parts.part_connection import ConnectionFailedError
from hal.replay.robot import ReplayRobot
from hal.replay.tape import TAPE_NAME, error_from_json, error_to_json
from tests.default_engine import DefaultRobot
from tests.hal.replay.story import Story, act, target


@pytest.fixture
def replay(recorded: tuple[Path, Story], robot_model: RobotModel) -> ReplayRobot:
    return ReplayRobot(robot_model, recording=recorded[0])


def same(one: Story, other: Story) -> None:
    assert one.odometry == other.odometry
    assert np.array_equal(one.positions, other.positions)
    assert [status for _, status in one.endings] == [status for _, status in other.endings]
    assert [took for took, _ in one.endings] == pytest.approx([took for took, _ in other.endings])
    for a, b in zip(one.scans, other.scans, strict=True):
        assert np.array_equal(a.ranges, b.ranges)
        # Each clock has a start of its own.
        assert a.stamp - one.scans[0].stamp == pytest.approx(b.stamp - other.scans[0].stamp, abs=1e-6)
    for a, b in zip(one.images, other.images, strict=True):
        assert np.array_equal(a.rgb, b.rgb)
        assert np.array_equal(a.depth, b.depth)


@pytest.mark.slow
def test_the_same_program_sees_the_same(replay: ReplayRobot, recorded: tuple[Path, Story]) -> None:
    with replay:
        same(act(replay), recorded[1])
    with replay:  # from the beginning again
        same(act(replay), recorded[1])


@pytest.mark.slow
def test_a_run_is_the_same_whether_it_is_recorded_or_not(
    recorded: tuple[Path, Story], robot_model: RobotModel, empty_world: World
) -> None:
    with DefaultRobot(robot_model, empty_world, seed=3) as robot:
        same(act(robot), recorded[1])


def test_a_command_that_was_not_given_is_refused_with_the_one_that_was(replay: ReplayRobot) -> None:
    with replay:
        base = replay.part("base", MobileBase)
        with pytest.raises(CommandRefusedError, match=r"rotate\(1.000\).*the recording holds rotate\(0.300\)"):
            base.rotate(1.0)
        assert base.rotate(0.3).status is MotionStatus.RUNNING
        with pytest.raises(CommandRefusedError, match="no further rotate"):
            base.rotate(0.3)
        with pytest.raises(CommandRefusedError, match="has no such command"):
            replay.part("arm", Arm).servo(replay.part("arm", Arm).positions())


def test_how_far_a_trajectory_was_is_not_told_of_the_one_after_it(
    recorded: tuple[Path, Story], robot_model: RobotModel, tmp_path: Path
) -> None:
    lines = [json.loads(line) for line in gzip.decompress((recorded[0] / TAPE_NAME).read_bytes()).splitlines()]
    begins = next(line["t"] for line in lines if line.get("command") == "move_to")
    for moment, told in ((begins - 0.01, 1.4), (begins + 0.1, 0.1)):
        lines.append({"part": "arm", "read": "trajectory_time", "value": told, "t": moment})
    edited = "".join(json.dumps(line) + "\n" for line in sorted(lines, key=lambda line: line.get("t", -1.0)))
    (tmp_path / TAPE_NAME).write_bytes(gzip.compress(edited.encode()))
    with ReplayRobot(robot_model, recording=tmp_path) as replay:
        arm = replay.part("arm", Arm)
        assert not arm.move_to(target(arm)).done
        assert arm.trajectory_time() is None
        replay.clock.sleep(0.11)
        assert arm.trajectory_time() == 0.1


def test_the_recording_waits_for_a_program_that_thinks_longer(
    replay: ReplayRobot, recorded: tuple[Path, Story]
) -> None:
    with replay:
        base = replay.part("base", MobileBase)
        replay.clock.sleep(0.7)
        motion, begin = base.rotate(0.3), replay.clock.now()
        while not motion.done:
            replay.clock.sleep(0.05)
        assert motion.status is MotionStatus.SUCCEEDED
        assert replay.clock.now() - begin == pytest.approx(recorded[1].endings[0][0], abs=0.06)
        image = replay.part("head_camera", Camera).capture()
        assert replay.clock.now() - image.stamp < 5.0


def test_a_newer_command_and_a_stop_end_motions(replay: ReplayRobot) -> None:
    with replay:
        base, arm = replay.part("base", MobileBase), replay.part("arm", Arm)
        turning = base.rotate(0.3)
        base.set_velocity(0.1, 0.0, 0.0)
        assert turning.failure is not None
        assert turning.failure.code is MotionErrorCode.SUPERSEDED
        backing = base.move_backward(0.2)
        replay.stop()
        assert backing.status is MotionStatus.CANCELED
        with pytest.raises(CommandRefusedError, match="stopped"):
            arm.move_to(target(arm))
        replay.clear_stop()
        assert arm.move_to(target(arm)).status is MotionStatus.RUNNING


def test_what_nobody_has_read_and_what_came_after_the_end_is_missing(replay: ReplayRobot) -> None:
    with replay:
        with pytest.raises(NoDataError, match=r"efforts\(\) was never read"):
            replay.part("arm", Arm).efforts()
        replay.clock.sleep(60.0)
        with pytest.raises(NoDataError, match="the nearest is at"):
            replay.part("arm", Arm).positions()


def test_a_recording_of_another_robot_or_none_is_refused(
    recorded: tuple[Path, Story], replay: ReplayRobot, tmp_path: Path
) -> None:
    with pytest.raises(ConnectionFailedError, match="'diff_panda', not of 'diff_ur5'"):
        ReplayRobot(load_robot_model("diff_ur5"), recording=recorded[0]).connect()
    with pytest.raises(ConnectionFailedError, match="--record"):
        ReplayRobot(replay.model, recording=tmp_path).connect()
    (tmp_path / TAPE_NAME).write_bytes(b"nothing of the kind")
    with pytest.raises(ConnectionFailedError, match="is not a recording"):
        ReplayRobot(replay.model, recording=tmp_path).connect()


def test_a_run_that_was_killed_plays_up_to_there(recorded: tuple[Path, Story], robot_model, tmp_path: Path) -> None:
    lines = gzip.decompress((recorded[0] / TAPE_NAME).read_bytes()).splitlines(keepends=True)
    begun = b"".join(lines[:100]) + lines[100][:20]
    (tmp_path / TAPE_NAME).write_bytes(gzip.compress(begun)[:-4])
    cut = ReplayRobot(robot_model, recording=tmp_path)
    with cut:
        assert cut.part("arm", Arm).positions().shape == (7,)
        assert cut.tape.end < ReplayRobot(robot_model, recording=recorded[0]).tape.end


def test_pictures_taken_in_a_row_are_those_that_follow_one_another_in_the_recording(
    robot_model: RobotModel, tmp_path: Path
) -> None:
    camera = {"kind": "Camera", "description": {"intrinsics": None, "optical_frame": "eye"}}
    lines: list[dict[str, Any]] = [
        {"robot": robot_model.name, "start": 0.0, "time_step": 0.01, "parts": {"head_camera": camera}},
        *({"t": t, "read": "capture", "part": "head_camera", "value": t} for t in (1.0, 1.5, 9.0)),
    ]
    with gzip.open(tmp_path / TAPE_NAME, "wt") as stream:
        stream.writelines(json.dumps(line) + "\n" for line in lines)
    robot = ReplayRobot(robot_model, recording=tmp_path)
    for _ in range(2):  # connected again, it begins anew
        robot.connect()
        taken = [robot.part("head_camera", Camera).capture() for _ in range(3)]
        assert taken == [1.0, 1.5, 1.5]  # the next one is too far ahead
        robot.disconnect()


def test_an_error_keeps_the_part_and_the_vendors_code() -> None:
    told = NotConnectedError("arm delivers nothing", "arm", "C2")
    assert error_from_json({"part": "arm", **error_to_json(told)}).failure == told.failure
