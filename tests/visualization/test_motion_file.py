from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.motion_file import MAX_BYTES, MotionWriter, read_motion
from bestman_bt.visualization.snapshot import RobotSnapshot


def _moment(stamp: float, x: float = 0.0, elbow: float = 0.0, turn: float = 0.0) -> RobotSnapshot:
    return RobotSnapshot(
        stamp,
        round(stamp * 20),
        Pose(np.array([x, 0.0, 0.0])),
        {"elbow": elbow, "wrist": 0.5},
        body_poses={"cup": Pose.from_xyz_rpy((1.0, 2.0, 3.0), (0.0, 0.0, turn)), "door": Pose()},
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "motion.jsonl"


def _write(path: Path, *moments: RobotSnapshot) -> None:
    writer = MotionWriter(path)
    for moment in moments:
        writer.write(moment)
    writer.close()


def test_what_was_written_is_read_back_counted_from_the_first_moment(path: Path) -> None:
    _write(path, _moment(7.0, 1.0, 0.1), _moment(7.1, 1.5, 0.1), _moment(7.3, 1.5, -0.4, math.pi / 2))

    motion = read_motion(path)

    assert motion.times == pytest.approx([0.0, 0.1, 0.3])
    assert motion.duration == pytest.approx(0.3)
    last = motion.at(0.3)
    assert last.tick == 146
    assert last.map_from_base.position == pytest.approx([1.5, 0.0, 0.0])
    assert last.joint_positions == pytest.approx({"elbow": -0.4, "wrist": 0.5})
    assert last.body_poses["cup"].position == pytest.approx([1.0, 2.0, 3.0])
    assert last.body_poses["cup"].quaternion == pytest.approx([0, 0, math.sqrt(0.5), math.sqrt(0.5)], abs=1e-4)


def test_between_two_moments_everything_is_in_proportion(path: Path) -> None:
    _write(path, _moment(0.0, 1.0, 0.0, -0.1), _moment(0.2, 2.0, 0.8, 0.1))

    motion = read_motion(path)
    halfway = motion.at(0.1)

    assert [motion.at(time).tick for time in (0.0, 0.1, 0.19, 0.2)] == [0, 0, 0, 4]
    assert halfway.map_from_base.position == pytest.approx([1.5, 0.0, 0.0])
    assert halfway.joint_positions["elbow"] == pytest.approx(0.4)
    assert halfway.body_poses["cup"].quaternion == pytest.approx([0, 0, 0, 1])


def test_a_rotation_takes_the_short_way_whatever_the_sign_of_its_quaternion(path: Path) -> None:
    near_half = Pose(np.zeros(3), np.array([0.0, 0.0, 1.0, 0.01]))
    other_sign = Pose(np.zeros(3), np.array([0.0, 0.0, -1.0, 0.01]))
    _write(
        path,
        RobotSnapshot(0.0, 0, Pose(), {}, body_poses={"cup": near_half}),
        RobotSnapshot(1.0, 1, Pose(), {}, body_poses={"cup": other_sign}),
    )

    assert abs(read_motion(path).at(0.5).body_poses["cup"].quaternion[2]) == pytest.approx(1.0, abs=1e-3)


def test_before_and_after_the_run_everything_stands(path: Path) -> None:
    _write(path, _moment(0.0, 1.0), _moment(0.2, 2.0))

    motion = read_motion(path)

    assert motion.at(-5.0).map_from_base.position[0] == pytest.approx(1.0)
    assert motion.at(99.0).map_from_base.position[0] == pytest.approx(2.0)


def test_what_stands_still_costs_a_few_bytes(path: Path) -> None:
    _write(path, *(_moment(0.1 * i) for i in range(100)))

    assert path.stat().st_size < 100 * 30 + 400


def test_a_run_that_was_killed_is_read_to_the_last_whole_line(path: Path) -> None:
    writer = MotionWriter(path)
    writer.write(_moment(0.0, 1.0))
    writer.write(_moment(0.1, 2.0))  # never closed
    with path.open("a") as file:
        file.write('{"time":0.2,"tick":4,"ba')

    assert read_motion(path).duration == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no motion of a run"),
        ("<script>\n", ":1: no motion of a run"),
        ('{"motion": 9, "joints": [], "bodies": []}\n', "should begin with"),
        ('{"motion": 1, "joints": [], "bodies": []}\n', "it contains no moments"),
        ('{"motion": 1, "joints": ["a"], "bodies": []}\n{"time": 0, "tick": 0, "base": [0,0,0,0,0,0,1]}\n', "missing"),
        (
            '{"motion": 1, "joints": [], "bodies": []}\n{"time": 0, "tick": 0, "base": [0,0,0,0,0,0,9]}\n',
            ":2: .*quatern",
        ),
        (
            '{"motion": 1, "joints": [], "bodies": []}\n{"time": 0, "tick": 0, "joints": {"7": 1}}\n',
            "no joint number 7",
        ),
        ('{"motion": 1, "joints": [], "bodies": []}\n' + "[" * 100_000 + "\n", ":2: no motion"),
    ],
)
def test_a_damaged_file_is_refused_with_its_line(path: Path, text: str, words: str) -> None:
    path.write_text(text)

    with pytest.raises(RecordingError, match=words):
        read_motion(path)


def test_a_file_that_is_too_large_is_not_read(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)

    with pytest.raises(RecordingError, match=f"at most {MAX_BYTES}"):
        read_motion(path)


def test_a_file_that_unfolds_to_too_much_is_not_read(path: Path) -> None:
    names = ",".join(f'"{i}"' for i in range(1000))
    path.write_text(f'{{"motion": 1, "joints": [], "bodies": [{names}]}}\n' + '{"time":0,"tick":0}\n' * 3000)

    with pytest.raises(RecordingError, match="too many"):
        read_motion(path)
