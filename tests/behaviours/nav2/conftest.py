"""A robot in the kitchen that drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import known_world

START = (
    "scene.robot_start.x=[-2.0, -2.0]",
    "scene.robot_start.y=[-0.3, -0.3]",
    "scene.robot_start.yaw=[0.0, 0.0]",
)
"""Facing the doorway, with room all around."""
CHAIR = """
extends: kitchen
description: The kitchen, and a chair on the way to the table that the map does not know.
unmapped: {chair: {model: chair, at: [0.9, -0.3, 0]}}
"""


@pytest.fixture
def kitchen() -> Iterator[Callable[..., tuple[RobotSession, GroundTruth]]]:
    """Opens sessions of a robot that faces the doorway."""
    with ExitStack() as stack:

        def opened(scene: str | Path = "kitchen", seed: int = 1) -> tuple[RobotSession, GroundTruth]:
            config = load_run("navigate_kitchen", scene=scene, seed=seed, settings=START)
            return stack.enter_context(known_world(config))

        yield opened


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    """A scene with a chair in the way."""
    scene = tmp_path / "chair.yaml"
    scene.write_text(CHAIR)
    return scene


@pytest.fixture(scope="module")
def driver() -> Iterator[RobotSession]:
    """One robot for all tests of a module that move it no more than a little, and back."""
    with known_world(load_run("navigate_kitchen", seed=1, settings=START)) as (session, _):
        yield session
