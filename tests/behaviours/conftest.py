"""A simulated robot that stands at the table, in arm's reach of the cup."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.runtime.robot_session import RobotSession, session
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.at_the_table import standing_at_a_table
from tests.behaviours.driving import BEFORE_THE_DOORWAY
from tests.behaviours.truth import THINGS, known_world


@pytest.fixture
def at_table() -> Iterator[RobotSession]:
    """A robot of its own for each test."""
    with session(seed=1, settings=standing_at_a_table(110.0)) as opened:
        yield opened


@pytest.fixture(scope="module")
def bystander() -> Iterator[RobotSession]:
    """One robot for all tests of a module that leave the world as it is."""
    with session(seed=1, settings=standing_at_a_table(-70.0)) as opened:
        yield opened


@pytest.fixture
def kitchen_with(tmp_path: Path) -> Iterator[Callable[..., tuple[RobotSession, GroundTruth]]]:
    """Opens sessions in a kitchen without things, before its doorway, with what is added to its scene file."""
    with ExitStack() as stack:

        def opened(*added: str) -> tuple[RobotSession, GroundTruth]:
            scene = tmp_path / "changed.yaml"
            scene.write_text("\n".join([THINGS.strip(), BEFORE_THE_DOORWAY, *added, "goals: {}\n"]))
            return stack.enter_context(known_world(load_run(tree="navigate", scene=scene, robot="diff_panda", seed=1)))

        yield opened
