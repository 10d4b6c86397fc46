from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode_measures import MotionLog
from bestman_bt.evaluation.film.filmed_run import FilmedRun, read_filmed_run
from bestman_bt.evaluation.film.rendering import ReplayScene
from bestman_bt.evaluation.run_folder import make_run_folder
from bestman_bt.runtime.resolved_config import prepare
from hal.simulation.scene_recorder import SceneRecorder
from tests.default_engine import DefaultRobot


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in which the robot stands still for a second before a fridge."""
    config = load_run("fetch_from_fridge", seed=3)
    folder = make_run_folder(config, tmp_path_factory.mktemp("runs"))
    setup = prepare(config)
    with DefaultRobot(setup.robot_model, setup.world, seed=config.seed) as robot:
        log = MotionLog(folder, SceneRecorder(robot))
        log.open()
        robot.clock.sleep(1.0)
        log.close()
    return folder


@pytest.fixture(scope="session")
def run(run_folder: Path) -> FilmedRun:
    return read_filmed_run(run_folder)


@pytest.fixture(scope="session")
def stage(run: FilmedRun) -> Iterator[ReplayScene]:
    with ReplayScene(run) as stage:
        yield stage
