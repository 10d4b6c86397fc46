"""Arms that give way to each other: who waits, who goes on, who gives up; scripted arms, real geometry."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.control.arm.arm_coordinator import ArmCoordinator, Passing
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.messages import MotionErrorCode
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import WorldModel
from hal.api import Motion, MotionStatus, NotConnectedError
from tests.control.scripted_parts import ScriptedArm, ScriptedMotion, stepped_clock
from tests.manipulation.two_arms import home, two_arms

ACROSS, INWARD, ASIDE = 0.6, -1.2, -1.2
"""Of the joint ``pan``, radians: the right arm lies across the left one's way from 0 to ``INWARD``, or is out of it."""
PASSING = Passing(period=0.1, patience=2.0)
IN_THE_WAY = MotionErrorCode.OTHER_ARM_IN_THE_WAY


@dataclass
class Scene:
    """``arms`` are where a test puts them; a motion of one ends when a test ends it."""

    robot: RobotModel
    arms: dict[str, ScriptedArm]
    coordinator: ArmCoordinator
    clock: object
    started: list[str] = field(default_factory=list)

    def at(self, side: str, pan: float) -> NDArray[np.float64]:
        """Joint positions (7,) at home but turned about the post."""
        positions = home(self.robot, side).copy()
        positions[self.robot.of(ArmModel)[side].joint_names.index(f"{side}_pan")] = pan
        return positions

    def put(self, side: str, pan: float) -> None:
        """The arm is there now."""
        self.arms[side].at = self.at(side, pan)

    def go(self, side: str, *pans: float) -> Motion[None]:
        """Ask for a way through these; without any, for one that is not known before."""
        path = np.array([self.at(side, pan) for pan in pans]) if pans else None

        def begin() -> Motion[None]:
            self.started.append(side)
            return self.arms[side].move_to(self.arms[side].at)

        return self.coordinator.start(side, path, begin)

    def under_way(self, side: str) -> ScriptedMotion:
        """The motion that the arm itself carries out."""
        return self.arms[side].motions[-1]


@pytest.fixture
def scene() -> Scene:
    robot, clock = two_arms(), stepped_clock()
    arms = {side: ScriptedArm(home(robot, side), name=side) for side in ("left", "right")}
    for side, arm in arms.items():
        arm.model = robot.of(ArmModel)[side]
    sensor = JointStateSensor(arms, robot)
    return Scene(robot, arms, ArmCoordinator(robot, sensor, WorldModel(SemanticMap((), {})), clock, PASSING), clock)


def right_sweeps_outwards(scene: Scene) -> None:
    """Under way from across the left arm's way to where it is out of it."""
    scene.put("right", ACROSS)
    scene.go("right", ACROSS, ASIDE)


def test_ways_that_do_not_meet_are_gone_at_the_same_time(scene: Scene) -> None:
    scene.go("right", 0.0, -1.2)
    scene.go("left", 0.0, 1.2)
    assert scene.started == ["right", "left"]


def test_an_arm_waits_until_what_is_left_of_the_other_way_is_clear_of_its_own(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    motion = scene.go("left", 0.0, INWARD)
    for pan in (0.6, 0.5):
        scene.put("right", pan)
        scene.clock.sleep(0.3)
        assert (motion.status, scene.started) == (MotionStatus.RUNNING, ["right"]), pan
    scene.put("right", ASIDE)
    scene.clock.sleep(0.15)
    assert not scene.under_way("right").done
    assert scene.started == ["right", "left"]
    scene.under_way("left").succeed()
    assert motion.status is MotionStatus.SUCCEEDED
    scene.clock.sleep(0.5)
    assert scene.started == ["right", "left"], "once"


def test_an_arm_that_waits_gives_up_after_its_patience(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    motion = scene.go("left", 0.0, INWARD)
    scene.clock.sleep(PASSING.patience - 0.1)
    assert not motion.done
    scene.clock.sleep(0.2)
    assert (motion.status, motion.failure.code, motion.failure.part) == (MotionStatus.FAILED, IN_THE_WAY, "left")
    assert motion.failure.text == "arm right blocks its path for longer than it waits"
    scene.put("right", ASIDE)
    scene.clock.sleep(0.5)
    assert scene.started == ["right"]


def test_what_is_cancelled_while_it_waits_never_starts(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    motion = scene.go("left", 0.0, INWARD)
    motion.cancel()
    scene.put("right", ASIDE)
    scene.under_way("right").succeed()
    scene.clock.sleep(0.5)
    assert (motion.status, scene.started) == (MotionStatus.CANCELED, ["right"])


def test_an_arm_that_is_stopped_while_it_waits_never_starts(scene: Scene) -> None:
    scene.put("left", 0.0)
    right_sweeps_outwards(scene)
    arm = ArmController(scene.arms["left"], scene.clock, coordinator=scene.coordinator)
    motion = arm.move_to(scene.at("left", INWARD))
    assert not motion.done
    arm.stop()
    scene.put("right", ASIDE)
    scene.under_way("right").succeed()
    scene.clock.sleep(0.5)
    assert (motion.status, motion.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.STOPPED)
    assert scene.arms["left"].motions == []


def test_a_cancel_after_the_wait_reaches_the_arm(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    motion = scene.go("left", 0.0, INWARD)
    scene.put("right", ASIDE)
    scene.clock.sleep(0.15)
    motion.cancel()
    assert scene.under_way("left").status is MotionStatus.CANCELED


@pytest.mark.parametrize("ends", [False, True], ids=["rests there", "comes to rest there"])
def test_another_path_is_needed_at_once_where_the_other_arm_rests_in_the_way(scene: Scene, ends: bool) -> None:
    if ends:
        scene.put("right", ASIDE)
        scene.go("right", ASIDE, ACROSS)
    else:
        scene.put("right", ACROSS)
    before = list(scene.started)
    motion = scene.go("left", 0.0, INWARD)
    assert (motion.failure.code, motion.failure.text) == (IN_THE_WAY, "arm right rests in its way")
    assert scene.started == before
    planned_with = scene.coordinator.for_planning("left")
    where = [planned_with[name] for name in scene.robot.of(ArmModel)["right"].joint_names]
    np.testing.assert_allclose(where, scene.at("right", ACROSS), atol=1e-9)
    if not ends:  # the planner has judged the arm where it rests: its path counts, not the hulls around it
        scene.go("left", 0.0, INWARD)
        assert scene.started == [*before, "left"]


def test_what_was_planned_with_the_other_arm_elsewhere_does_not_count(scene: Scene) -> None:
    scene.put("right", ASIDE)
    scene.coordinator.for_planning("left")
    scene.put("right", ACROSS)
    assert scene.go("left", 0.0, INWARD).failure.code is IN_THE_WAY


@pytest.mark.parametrize(("right", "left"), [((), (0.0, 1.2)), ((0.0, -1.2), ())])
def test_a_way_that_is_not_known_before_is_gone_alone(
    scene: Scene, right: tuple[float, ...], left: tuple[float, ...]
) -> None:
    scene.go("right", *right)
    scene.go("left", *left)
    scene.clock.sleep(0.5)
    assert scene.started == ["right"]
    scene.under_way("right").succeed()
    scene.clock.sleep(0.15)
    assert scene.started == ["right", "left"]


def test_a_newer_command_ends_the_one_that_waits(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    first = scene.go("left", 0.0, INWARD)
    scene.go("left", 0.0, 1.2)
    assert (first.failure.code, scene.started) == (MotionErrorCode.SUPERSEDED, ["right", "left"])


def test_a_motion_that_takes_over_from_one_of_the_same_arm_does_not_wait(scene: Scene) -> None:
    scene.go("left", 0.0, 1.2)
    right_sweeps_outwards(scene)
    assert scene.go("left", 0.0, INWARD).failure.code is IN_THE_WAY
    assert scene.started == ["left", "right"]
    assert not scene.under_way("left").done


def test_encoders_that_are_gone_end_the_wait(scene: Scene) -> None:
    right_sweeps_outwards(scene)
    motion = scene.go("left", 0.0, INWARD)
    scene.arms["right"].error = NotConnectedError("the wire is cut")
    scene.clock.sleep(0.15)
    assert (motion.status, motion.failure.code) == (MotionStatus.FAILED, MotionErrorCode.DISCONNECTED)
