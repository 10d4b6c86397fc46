"""Behaviour cloning of reaching: what a few seconds of training are worth, and that they are worth the same again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest

from bestman_bt.manipulation.policy.base import ActionChunk, Observation
from bestman_bt.manipulation.policy.errors import PolicyActionError, PolicyModelError, PolicyObservationError
from bestman_bt.manipulation.policy.features import pose_vector
from bestman_bt.manipulation.policy.onnx_policy import OnnxPolicy
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.manipulation.policy.training.behaviour_cloning import BehaviourCloning, ClonedPolicy
from bestman_bt.manipulation.policy.training.demonstrations import Demonstration
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert, roll_out

TOLERANCE = 0.01, 0.1


def reached(policy: OnnxPolicy, expert: ReachingExpert, wrong_goal: bool = False, count: int = 30) -> int:
    total = 0
    for seed in range(100, 100 + count):
        rng = np.random.default_rng(seed)
        start, goal = expert.task(rng)
        other = expert.task(rng)[1]
        rollout = roll_out(policy, expert.kinematics, expert.arm, start, other if wrong_goal else goal, goal)
        total += rollout.reached(*TOLERANCE)
    return total


@pytest.mark.slow
def test_a_few_seconds_of_training_reach_nine_goals_of_ten(trained: Path, expert: ReachingExpert) -> None:
    assert reached(load_policy(trained), expert) >= 27


@pytest.mark.slow
def test_told_a_wrong_goal_the_policy_does_not_reach_the_right_one(trained: Path, expert: ReachingExpert) -> None:
    assert reached(load_policy(trained), expert, wrong_goal=True) == 0


def test_the_same_seed_trains_the_same_weights_and_another_seed_others(
    expert: ReachingExpert, few_demonstrations: list[Demonstration]
) -> None:
    parameters = BehaviourCloning(hidden=(16,), steps=50)
    specification = expert.specification("diff_panda")
    first, again, other = (
        replace(parameters, seed=seed).train(few_demonstrations, specification).layers[0][0] for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.slow
def test_demonstrations_end_where_they_were_to_end(demonstrations: list[Demonstration], expert: ReachingExpert) -> None:
    misses = []
    for demonstration in demonstrations[:50]:
        last = demonstration.observations[-1]
        end = expert.kinematics.tool_pose(last.joint_positions + demonstration.chunks[-1].sum(axis=0))
        misses.append(np.linalg.norm(end.position - last.goal[:3]))
    assert np.median(misses) < 0.001


def test_the_written_network_computes_what_was_trained(briefly_trained: Path, briefly_cloned: ClonedPolicy) -> None:
    policy = load_policy(briefly_trained)
    assert policy.specification == briefly_cloned.card.specification
    raw = policy.run(np.full((1, 20), 0.3, dtype=np.float32))
    value = np.full((1, 20), 0.3, dtype=np.float32)
    for weight, bias in briefly_cloned.layers[:-1]:
        value = value @ weight + bias
        value = value / (1.0 + np.exp(-value))
    np.testing.assert_allclose(raw, (value @ briefly_cloned.layers[-1][0] + briefly_cloned.layers[-1][1])[0], atol=1e-4)


@pytest.fixture
def copy(briefly_trained: Path, tmp_path: Path) -> Path:
    path = tmp_path / "reach.onnx"
    path.write_bytes(briefly_trained.read_bytes())
    path.with_suffix(".json").write_text(briefly_trained.with_suffix(".json").read_text())
    return path


@pytest.fixture
def seen(expert: ReachingExpert) -> Observation:
    start, goal = expert.task(np.random.default_rng(5))
    return Observation(start, expert.kinematics.tool_pose(start), pose_vector(goal), joint_velocities=np.zeros(7))


def test_weights_that_give_nan_are_an_action_error(copy: Path, seen: Observation) -> None:
    model = onnx.load(str(copy))
    bias = model.graph.initializer[-1]
    bias.raw_data = np.full(bias.dims, np.nan, dtype=np.float32).tobytes()
    onnx.save(model, str(copy))
    with pytest.raises(PolicyActionError, match="NaN"):
        load_policy(copy).act(seen)


def test_a_description_of_another_shape_than_the_network_is_refused(copy: Path, seen: Observation) -> None:
    card = json.loads(copy.with_suffix(".json").read_text())
    card["features"] = ["joint_positions"]
    copy.with_suffix(".json").write_text(json.dumps(card))
    with pytest.raises(PolicyModelError, match="takes"):
        load_policy(copy).act(seen)
    card["specification"]["horizon"] = 3
    copy.with_suffix(".json").write_text(json.dumps(card))
    with pytest.raises(PolicyModelError, match="3 x 7 joint actions"):
        _ = load_policy(copy).specification


def test_files_that_are_missing_or_something_else_are_refused(copy: Path, seen: Observation, tmp_path: Path) -> None:
    with pytest.raises(PolicyModelError, match="no ONNX file"):
        OnnxPolicy(str(tmp_path / "absent.onnx")).act(seen)
    copy.write_bytes(b"no network")
    with pytest.raises(PolicyModelError, match="not an ONNX model"):
        load_policy(copy).act(seen)
    copy.with_suffix(".json").unlink()
    with pytest.raises(PolicyModelError, match="does not describe a policy"):
        _ = load_policy(copy).specification


def test_an_observation_of_another_arm_or_without_a_pose_as_goal_is_refused(
    briefly_trained: Path, seen: Observation
) -> None:
    policy = load_policy(briefly_trained)
    assert isinstance(policy.act(seen), ActionChunk)
    with pytest.raises(PolicyObservationError, match="7 joints"):
        policy.act(replace(seen, joint_positions=np.zeros(6)))
    with pytest.raises(PolicyObservationError, match="velocities"):
        policy.act(replace(seen, joint_velocities=None))
    with pytest.raises(PolicyObservationError, match="unit quaternion"):
        policy.act(replace(seen, goal=seen.goal[:3]))
