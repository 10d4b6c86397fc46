"""Robots whose controllers' twins can fail, and the motion of each controller that a fault strikes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, Gripper, MobileBase, Motion, Robot
from hal.conformance.promises import MakeRobot
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from hal.twins.process import TwinProcess
from tests.hal.twinned import arm_comes_to_rest, swing_arm, twin_settings, wait_for, wait_in_twin

FOLDER = Path(__file__).parents[1] / "hal"
ARM, HAND, PLATFORM = "arm_controller", "hand_controller", "platform"


@dataclass(frozen=True)
class TwinnedRobot:
    """A robot file. ``sdk``: a module that the extra brings. ``taken_back``: connection → what ends a test's faults."""

    robot_file: Path
    extra: str
    sdk: str
    taken_back: Mapping[str, tuple[str, ...]] = field(hash=False)


XARM6 = TwinnedRobot(
    FOLDER / "xarm" / "xarm6_on_a_base.yaml", "xarm", "xarm", {ARM: ("restore", "released", "gripper_free")}
)
UR5E = TwinnedRobot(
    FOLDER / "ur" / "ur5e_on_a_base.yaml",
    "ur",
    "rtde_control",
    {ARM: ("restore", "released"), HAND: ("restore", "gripper_free")},
)
ROS = TwinnedRobot(
    FOLDER / "rosbridge" / "ros_robot.yaml",
    "rosbridge",
    "roslibpy",
    {PLATFORM: ("restore", "fresh_odometry", "free", "sighted", "clock_right")},
)


def fixtures_of(robot: TwinnedRobot | None = None) -> tuple[Any, ...]:
    """Fixtures ``twinned``, ``twin``, ``twin_model``, ``make_robot``, ``shared_robot``, ``isolated_robot``, ``robot``.

    Without ``robot``, ``twinned`` is the parameter of each test.
    """

    @pytest.fixture(scope="module")
    def twinned(request: pytest.FixtureRequest) -> TwinnedRobot:
        found: TwinnedRobot = robot or request.param
        # `make test` installs it; another installation may be without the vendor's SDK.
        pytest.importorskip(found.sdk, reason=f"the extra {found.extra} is not installed")
        return found

    @pytest.fixture(scope="module")
    def twin(twinned: TwinnedRobot) -> Iterator[TwinProcess]:
        with TwinProcess(twinned.robot_file, "pick_place_table", seed=1) as running:
            yield running

    @pytest.fixture(scope="module")
    def twin_model(twinned: TwinnedRobot, twin: TwinProcess) -> RobotModel:
        return load_robot_model(twinned.robot_file, twin_settings(twin))

    @pytest.fixture(scope="module")
    def make_robot(twin_model: RobotModel) -> MakeRobot:
        """For the promises of hal.conformance: as a program uses it."""
        return partial(IsolatedRobot, twin_model)

    @pytest.fixture(scope="module")
    def shared_robot(twin_model: RobotModel) -> Iterator[HardwareRobot]:
        with HardwareRobot(twin_model) as robot:
            yield robot

    @pytest.fixture(scope="module")
    def isolated_robot(twin_model: RobotModel) -> Iterator[IsolatedRobot]:
        """With its connections in a process of their own."""
        with IsolatedRobot(twin_model) as robot:
            yield robot

    @pytest.fixture
    def robot_of_a_test(
        shared_robot: HardwareRobot, twin: TwinProcess, twinned: TwinnedRobot
    ) -> Iterator[HardwareRobot]:
        """Connected and well; faults that a test makes are taken back."""
        yield shared_robot
        for connection, names in twinned.taken_back.items():
            for name in names:
                twin.fault(connection, name)
        shared_robot.clear_stop()

    return twinned, twin, twin_model, make_robot, shared_robot, isolated_robot, robot_of_a_test


@dataclass(frozen=True)
class Controller:
    """``begin``: a motion that is well under way; ``moved``: the part's true position; ``rests``: it comes to rest by
    itself once its client is gone. ``read``: a reading that needs the link.
    """

    name: str
    robot: TwinnedRobot
    connection: str
    part: str
    begin: Callable[[HardwareRobot], Motion]
    read: Callable[[Robot], object]
    place: Callable[[TwinProcess], NDArray[np.float64]]
    rests: Callable[[TwinProcess], None]


def arm_place(twin: TwinProcess) -> NDArray[np.float64]:
    """Joints of the arm."""
    return np.array(twin.judge("joints", "arm")["positions"])


def read_arm(robot: Robot) -> object:
    return robot.part("arm", Arm).positions()


def turn(robot: HardwareRobot) -> Motion:
    """A turn on the spot that is well under way."""
    base = robot.part("base", MobileBase)
    motion = base.rotate(2.0)
    wait_for(lambda: motion.done or base.velocity().wz > 0.3, "the base turns")
    assert not motion.done, motion.failure
    return motion


def base_place(twin: TwinProcess) -> NDArray[np.float64]:
    """Pose of the base."""
    pose = twin.judge("base_pose")
    return np.array(pose["quaternion"] + pose["position"])


def base_comes_to_rest(twin: TwinProcess) -> None:
    """By itself: its dead-man, then braking from 1.2 rad/s at its own 2 rad/s²."""
    wait_in_twin(twin, 0.25 + 0.6 + 0.15)
    before = base_place(twin)
    wait_in_twin(twin, 0.4)
    assert np.max(np.abs(base_place(twin) - before)) < 1e-3


def move_fingers(robot: HardwareRobot) -> Motion:
    """Fingers that are under way to the other end, slowly."""
    gripper = robot.part("gripper", Gripper)
    here, widest = gripper.width(), gripper.model.max_width
    motion = gripper.move(0.2 * widest if here > 0.5 * widest else widest, speed=0.02)
    wait_for(lambda: motion.done or abs(gripper.width() - here) > 0.002, "the fingers move")
    assert not motion.done, motion.failure
    return motion


def read_gripper(robot: Robot) -> object:
    return robot.part("gripper", Gripper).width()


def fingers_place(twin: TwinProcess) -> NDArray[np.float64]:
    """Width of the hand."""
    return np.array([twin.judge("width", "gripper")])


def fingers_go_on(twin: TwinProcess) -> None:
    """A gripper goes to its last target without its client."""


XARM_ARM = Controller(
    "xarm", XARM6, ARM, "arm", partial(swing_arm, speed_scale=0.2), read_arm, arm_place, arm_comes_to_rest
)
XARM_HAND = Controller("xarm gripper", XARM6, ARM, "gripper", move_fingers, read_gripper, fingers_place, fingers_go_on)
UR_ARM = Controller("ur", UR5E, ARM, "arm", partial(swing_arm, speed_scale=0.1), read_arm, arm_place, arm_comes_to_rest)
ROBOTIQ = Controller("robotiq", UR5E, HAND, "gripper", move_fingers, read_gripper, fingers_place, fingers_go_on)
ROS_BASE = Controller(
    "rosbridge",
    ROS,
    PLATFORM,
    "base",
    turn,
    lambda robot: robot.part("base", MobileBase).odometry(),
    base_place,
    base_comes_to_rest,
)
CONTROLLERS = {controller.name: controller for controller in (XARM_ARM, XARM_HAND, UR_ARM, ROBOTIQ, ROS_BASE)}
