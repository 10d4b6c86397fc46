"""The options of ``pytest --pyargs hal.conformance``, and the robot that they name."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.draw import SceneError, draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.scene import Wall, World
from hal.api import Robot

ROBOT_UNDER_TEST = pytest.StashKey[Callable[[], Robot]]()
EXAMPLE = "--driver my_package:MyRobot"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that select the driver and its arguments."""
    group = parser.getgroup("conformance of a robot driver")
    group.addoption("--driver", metavar="MODULE:CLASS", help="the implementation of hal.api.Robot to test")
    group.addoption("--robot", default="diff_panda", metavar="NAME|FILE", help="the robot, or its YAML [diff_panda]")
    group.addoption("--scene", metavar="NAME|FILE", help="the scene of a simulated driver [an empty room]")
    group.addoption("--seed", type=int, default=0, metavar="N", help="of the scene and of the driver [0]")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Create the robot once, before the tests: invalid options end the session with a usage error."""
    options, folder = session.config.option, str(session.config.invocation_params.dir)
    if folder not in sys.path:
        sys.path.insert(0, folder)  # as for ``python -m pytest``: a driver beside the command is found
    driver = _imported(options.driver)
    make: Callable[[], Any] = partial(
        driver, _model(options.robot), _world(options.scene, options.seed), seed=options.seed, gui=False
    )
    try:
        robot = make()
    except TypeError as error:
        message = f"--driver {options.driver} cannot be made of (model, world, *, seed, gui): {error}"
        raise pytest.UsageError(message) from error
    if not isinstance(robot, Robot):
        raise pytest.UsageError(f"--driver {options.driver} made a {type(robot).__name__}, not a hal.api.Robot")
    session.config.stash[ROBOT_UNDER_TEST] = make


def _imported(driver: str | None) -> Callable[..., Any]:
    if driver is None:
        raise pytest.UsageError(f"name the driver to test: {EXAMPLE}")
    module, _, name = driver.partition(":")
    if not all(part.isidentifier() for part in (*module.split("."), *name.split("."))):
        raise pytest.UsageError(f"--driver {driver!r} should be MODULE:CLASS, for example {EXAMPLE}")
    try:
        found: Any = import_module(module)
    except Exception as error:  # a stranger's module may raise anything when it is imported
        message = f"--driver {driver}: {module} cannot be imported: {type(error).__name__}: {error}"
        raise pytest.UsageError(message) from error
    for part in name.split("."):
        if not hasattr(found, part):
            raise pytest.UsageError(f"--driver {driver}: {module} has no {name!r}")
        found = getattr(found, part)
    if not callable(found):
        raise pytest.UsageError(f"--driver {driver}: {name} is a {type(found).__name__}, not a class")
    made: Callable[..., Any] = found
    return made


def _model(robot: str) -> RobotModel:
    try:
        return load_robot_model(robot)
    except (OSError, ValueError) as error:
        raise pytest.UsageError(f"--robot {robot}: {error}") from error


def _world(scene: str | None, seed: int) -> World:
    try:
        return empty_room() if scene is None else draw_world(load_scene(scene), seed)
    except (OSError, ValueError, SceneError) as error:
        raise pytest.UsageError(f"--scene {scene}: {error}") from error


def empty_room() -> World:
    """Return a world with four walls, 3 m away from the robot."""
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
    walls = tuple(Wall(a, b, 1.2, 0.1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    return World("empty", 0, walls, (), (), Pose2D(0.0, 0.0, 0.0), {})
