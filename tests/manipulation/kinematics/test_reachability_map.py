from __future__ import annotations

import logging

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.reachability_map import (
    ReachabilitySampling,
    ScrewChain,
    cache_folder,
    even_directions,
    reachability_map,
)
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel

SMALL = ReachabilitySampling(voxel=0.2, directions=12, samples=20_000)


@pytest.fixture(scope="module")
def full(kinematics, arm):
    return ReachabilitySampling(samples=300_000).build(kinematics, arm)


def test_many_positions_at_once_agree_with_the_kinematics_of_one(diff_panda, rng):
    kinematics, arm = DampedLeastSquares(diff_panda), diff_panda.of(ArmModel)["arm"]
    sampled = rng.uniform(arm.lower, arm.upper, (20, 7))
    positions, approaches, measures = ScrewChain.of(kinematics).reach(sampled)
    for i, q in enumerate(sampled):
        tool = kinematics.tool_pose(q)
        assert np.allclose(positions[i], tool.position, atol=1e-9)
        assert np.allclose(approaches[i], tool.rotation[:, 2], atol=1e-9)
        assert measures[i] == pytest.approx(kinematics.manipulability(q), abs=1e-9)


@pytest.mark.slow
def test_approaches_that_inverse_kinematics_solves_score_higher_than_those_it_does_not(kinematics, full, ready, rng):
    shoulder, reach = kinematics.reach
    points = shoulder + rng.uniform(-0.6 * reach, 0.6 * reach, (60, 3))
    aims = even_directions(60)[rng.permutation(60)]
    scores = full.score(points, aims)
    solved = np.array(
        [
            any(kinematics.solve(tool_pose(p, a, roll), ready, rng, attempts=8).found for roll in range(4))
            for p, a in zip(points, aims, strict=True)
        ]
    )
    assert 12 < solved.sum() < 50
    assert np.mean(scores[solved][:, None] > scores[~solved][None, :]) > 0.88


def tool_pose(position: np.ndarray, approach: np.ndarray, roll: float) -> Pose:
    """A pose whose z axis is ``approach``, turned about it by ``roll``."""
    side = np.cross(approach, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([np.cross(side, approach), side, approach])
    matrix[:3, 3] = position
    return Pose.from_matrix(matrix) @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, roll))


@pytest.mark.slow
def test_poses_out_of_reach_score_zero(kinematics, full):
    shoulder, reach = kinematics.reach
    far = shoulder + 1.3 * reach * even_directions(50)
    assert np.all(full.score(far, even_directions(50)) == 0.0)


def test_the_same_arm_gives_the_same_map(kinematics, arm):
    first, again = (SMALL.build(kinematics, arm) for _ in range(2))
    assert np.array_equal(first.counts, again.counts)
    assert np.array_equal(first.manipulability, again.manipulability)
    assert first.counts.sum() == SMALL.samples


def test_a_map_is_stored_and_found_again(kinematics, tmp_path):
    built = reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path)
    (file,) = tmp_path.iterdir()
    stamp = file.stat().st_mtime_ns
    found = reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path)
    assert file.stat().st_mtime_ns == stamp
    assert np.array_equal(built.counts, found.counts)
    assert np.array_equal(built.score([[0.4, 0, 0.4]], [[0, 0, -1]]), found.score([[0.4, 0, 0.4]], [[0, 0, -1]]))


def test_another_robot_or_other_parameters_have_a_file_of_their_own(kinematics, diff_panda, tmp_path):
    other, mobile = ReachabilitySampling(voxel=0.25, directions=12, samples=20_000), DampedLeastSquares(diff_panda)
    for arm, sampling in ((kinematics, SMALL), (kinematics, other), (mobile, SMALL)):
        reachability_map(arm, arm.arm_model, sampling, tmp_path)
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("content", [b"", b"not a map", b"PK\x03\x04 half a file"])
def test_a_broken_file_is_built_anew_and_reported(kinematics, tmp_path, caplog, content):
    built = reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        again = reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path)
    assert "cannot be used and is built again" in caplog.text
    assert np.array_equal(again.counts, built.counts)
    assert file.stat().st_size > 1000


def test_a_truncated_file_is_built_anew(kinematics, tmp_path):
    built = reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-200])
    assert np.array_equal(reachability_map(kinematics, kinematics.arm_model, SMALL, tmp_path).counts, built.counts)


def test_a_folder_that_cannot_be_written_costs_only_time(kinematics, tmp_path, caplog):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with caplog.at_level(logging.WARNING):
        built = reachability_map(kinematics, kinematics.arm_model, SMALL, blocked / "folder")
    assert "cannot be stored" in caplog.text
    assert built.counts.sum() == SMALL.samples


def test_the_users_cache_folder_is_taken(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "bestman-bt"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder().parts[-2:] == (".cache", "bestman-bt")


@pytest.mark.slow
def test_bad_requests_are_refused_by_name(full):
    with pytest.raises(ManipulationError, match=r"positions should be \(N, 3\) and finite"):
        full.score([[0, 0]], [[0, 0, 1]])
    with pytest.raises(ManipulationError, match="finite"):
        full.score([[np.nan, 0, 0]], [[0, 0, 1]])
