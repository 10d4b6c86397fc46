"""A reaching policy that was trained for a few seconds, for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.policy.training.behaviour_cloning import BehaviourCloning, ClonedPolicy
from bestman_bt.manipulation.policy.training.demonstrations import Demonstration
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert
from bestman_bt.robot_model.model import ArmModel, RobotModel

BRIEF = BehaviourCloning(hidden=(16,), steps=50)
SHORT = BehaviourCloning(hidden=(96, 96), steps=2500, batch=128, rate=4e-3)


@pytest.fixture(scope="session")
def expert(diff_panda: RobotModel) -> ReachingExpert:
    arm = diff_panda.of(ArmModel)["arm"]
    return ReachingExpert(DampedLeastSquares(diff_panda), arm, diff_panda.posture("home", arm.joint_names))


@pytest.fixture(scope="session")
def demonstrations(expert: ReachingExpert) -> list[Demonstration]:
    rng = np.random.default_rng(1)
    return [expert.demonstrate(rng) for _ in range(300)]


@pytest.fixture(scope="session")
def few_demonstrations(expert: ReachingExpert) -> list[Demonstration]:
    rng = np.random.default_rng(1)
    return [expert.demonstrate(rng) for _ in range(20)]


@pytest.fixture(scope="session")
def briefly_cloned(expert: ReachingExpert, few_demonstrations: list[Demonstration]) -> ClonedPolicy:
    """It has learned next to nothing: for tests of files and of what goes in and out."""
    return BRIEF.train(few_demonstrations, expert.specification("diff_panda"))


@pytest.fixture(scope="session")
def briefly_trained(briefly_cloned: ClonedPolicy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("policy") / "brief.onnx"
    briefly_cloned.save(path)
    return path


@pytest.fixture(scope="session")
def cloned(expert: ReachingExpert, demonstrations: list[Demonstration]) -> ClonedPolicy:
    return SHORT.train(demonstrations, expert.specification("diff_panda"))


@pytest.fixture(scope="session")
def trained(cloned: ClonedPolicy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("policy") / "reach.onnx"
    cloned.save(path)
    return path
