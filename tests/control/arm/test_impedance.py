"""An arm that gives way does so as a spring of the stiffness that was asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pybullet
import pytest

from bestman_bt.control import MotionStatus
from bestman_bt.control.arm import ImpedanceController, ImpedanceParameters
from bestman_bt.manipulation.kinematics import ArmDynamics, DampedLeastSquares
from bestman_bt.messages import MotionErrorCode, Pose, Pose2D
from bestman_bt.robot_model import ArmModel, GripperModel, load_robot_model
from bestman_bt.scene import World
from hal.api import Arm
from hal.pybullet import PhysicsParameters, PyBulletRobot
from hal.simulation import GroundTruth


class Pushed:
    """A robot at its posture ``home`` whose tool is pushed by ``force`` (3,) N in the map, in every step."""

    def __init__(self, robot: PyBulletRobot, parameters: ImpedanceParameters) -> None:
        self.robot, self.arm, self.truth = robot, robot.part("arm", Arm), GroundTruth(robot)
        model = robot.model
        kinematics = DampedLeastSquares(model, "arm")
        hand = {j: q for g in model.of(GripperModel).values() for j, q in g.joint_positions(g.max_width).items()}
        dynamics = ArmDynamics(model, model.of(ArmModel)["arm"], hand)
        self.controller = ImpedanceController(self.arm, robot.clock, kinematics, dynamics, parameters)
        self.force = np.zeros(3)
        self._tool = model.of(ArmModel)["arm"].tool_frame
        simulation = robot.simulation
        holder, _ = simulation.built.frames.get(self._tool, (self._tool, None))
        link = simulation.built.links[holder]

        def push() -> None:
            at, force = self.tool.position.tolist(), self.force.tolist()
            simulation.engine.client.applyExternalForce(simulation.built.robot, link, force, at, pybullet.WORLD_FRAME)

        simulation.effort_controls.append(push)

    @property
    def tool(self) -> Pose:
        return self.truth.frame_pose(self._tool)


@pytest.fixture
def pushed() -> Callable[..., Pushed]:
    robots = []

    def make(parameters: ImpedanceParameters, name: str = "diff_panda") -> Pushed:
        robot = PyBulletRobot(
            load_robot_model(name),
            World("floor", 0, (), (), (), Pose2D(), {}),
            parameters=PhysicsParameters(initial_postures=("home",)),
        )
        robot.connect()
        robots.append(robot)
        return Pushed(robot, parameters)

    yield make
    for robot in robots:
        robot.disconnect()


@pytest.mark.parametrize(
    ("name", "stiffness"),
    [
        ("diff_panda", 400.0),
        pytest.param("diff_panda", 800.0, marks=pytest.mark.slow),
        pytest.param("omni_ur5", 400.0, marks=pytest.mark.slow),
    ],
)
def test_a_force_moves_the_tool_by_force_over_stiffness(pushed, name: str, stiffness: float) -> None:
    it = pushed(ImpedanceParameters(stiffness=stiffness), name)
    handle = it.controller.hold()
    it.robot.clock.sleep(0.5)
    start = it.tool.position
    for axis in range(3):
        it.force = 15.0 * np.eye(3)[axis]
        it.robot.clock.sleep(1.2)
        assert it.tool.position - start == pytest.approx(it.force / stiffness, abs=0.2 * 15.0 / stiffness)
    it.force = np.zeros(3)
    it.robot.clock.sleep(1.2)
    assert it.tool.position == pytest.approx(start, abs=0.001)
    assert handle.status is MotionStatus.RUNNING


def test_a_moved_target_pulls_the_tool_along_without_overshooting_much(pushed) -> None:
    it = pushed(ImpedanceParameters())
    it.controller.hold()
    start, highest = it.tool.position[2], 0.0
    target = it.controller.target
    it.controller.move_target(Pose(target.position + np.array([0.0, 0.0, 0.05]), target.quaternion))
    for _ in range(40):
        it.robot.clock.sleep(0.05)
        highest = max(highest, it.tool.position[2] - start)
    assert it.tool.position[2] - start == pytest.approx(0.05, abs=0.002)
    assert highest < 0.057


def test_cancelling_makes_the_arm_stiff_where_it_is(pushed) -> None:
    it = pushed(ImpedanceParameters())
    handle = it.controller.hold()
    it.robot.clock.sleep(0.3)
    handle.cancel()
    it.robot.clock.sleep(0.5)
    start = it.tool.position
    it.force = np.array([0.0, 15.0, 0.0])
    it.robot.clock.sleep(0.5)
    assert handle.status is MotionStatus.CANCELED
    assert np.linalg.norm(it.tool.position - start) < 0.005


def test_a_stop_of_the_robot_ends_it(pushed) -> None:
    it = pushed(ImpedanceParameters())
    first = it.controller.hold()
    handle = it.controller.hold()
    assert first.failure is not None
    assert first.failure.code is MotionErrorCode.SUPERSEDED
    first.cancel()
    it.robot.clock.sleep(0.2)
    assert handle.status is MotionStatus.RUNNING
    it.robot.stop()
    it.robot.clock.sleep(0.2)
    assert handle.failure is not None
    assert handle.failure.code is MotionErrorCode.STOPPED


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_arm_that_is_thrown_about_is_braked(pushed, side: float) -> None:
    it = pushed(ImpedanceParameters(speed_share=0.2))
    handle = it.controller.hold()
    it.force = np.array([0.0, side * 300.0, 0.0])
    for _ in range(50):
        it.robot.clock.sleep(0.01)
        if handle.done:
            break
    assert handle.failure is not None
    assert handle.failure.code is MotionErrorCode.TRACKING
    it.force = np.zeros(3)
    it.robot.clock.sleep(0.5)
    assert np.abs(it.arm.velocities()).max() < 0.05, "it holds where it is"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_one_joint_that_is_too_fast_is_named(pushed, monkeypatch: pytest.MonkeyPatch, side: float) -> None:
    it = pushed(ImpedanceParameters(speed_share=0.5))
    speeds = 0.4 * it.arm.model.velocity
    speeds[3] *= 1.5 * side
    monkeypatch.setattr(it.arm, "velocities", lambda: speeds)
    handle = it.controller.hold()
    assert handle.failure is not None
    assert handle.failure.code is MotionErrorCode.TRACKING
    assert it.arm.joint_names[3] in handle.failure.text


def test_a_spring_that_pulls_harder_than_the_joints_can_is_cut_off_at_their_limits(pushed) -> None:
    it = pushed(ImpedanceParameters(stiffness=6000.0, turn_stiffness=600.0))
    here = it.controller.hold()
    target = it.controller.target
    here.cancel()
    away = Pose(target.position + np.array([0.1, 0.1, 0.1]), target.quaternion)
    assert it.controller.hold(away).status is MotionStatus.RUNNING


def test_parameters_that_mean_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="stiffness"):
        ImpedanceParameters(stiffness=0.0)
