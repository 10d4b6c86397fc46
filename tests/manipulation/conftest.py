from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel, CoalCollisionWorld
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from tests.manipulation.fixed_ur5 import fixed_ur5
from tests.manipulation.pybullet_referee import Referee
from tests.manipulation.table_and_shelf import fixed_panda, table_and_shelf


@pytest.fixture(scope="session")
def panda() -> RobotModel:
    return fixed_panda()


@pytest.fixture(scope="session")
def arm(panda: RobotModel) -> ArmModel:
    return panda.of(ArmModel)["arm"]


@pytest.fixture(scope="session")
def kinematics(panda: RobotModel) -> DampedLeastSquares:
    return DampedLeastSquares(panda)


@pytest.fixture(scope="session")
def ur5() -> DampedLeastSquares:
    return DampedLeastSquares(fixed_ur5())


@pytest.fixture(scope="session")
def collision_model(panda: RobotModel) -> CoalCollisionModel:
    return CoalCollisionModel(panda)


@pytest.fixture(scope="session")
def world(collision_model: CoalCollisionModel) -> CoalCollisionWorld:
    return collision_model.world(table_and_shelf())


@pytest.fixture(scope="session")
def diff_panda() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture(scope="session")
def referee() -> Iterator[Referee]:
    judge = Referee()
    yield judge
    judge.close()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def ready() -> np.ndarray:
    return np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.785])
