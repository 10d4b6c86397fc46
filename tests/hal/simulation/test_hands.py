"""Hands of several kinds hold by contact and friction, and by nothing else."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.evaluation.audit import audit
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import combine
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.robot_model.part_config import SuctionPart
from hal.api import Arm, Gripper, JointGroup
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.parameters import SimulationParameters
from hal.simulation.robot import SimulatedRobot
from hal.simulation.suction import BUILD_UP, SuctionPump
from tests.default_engine import DefaultRobot

ALLOWED = [("fingers", "box"), ("fingers", "can"), ("box", "table"), ("can", "table")]
TOP = 0.85


MORE = ("pr2_gripper", "wsg50")


@pytest.mark.parametrize("name", ["xarm_gripper", *(pytest.param(name, marks=pytest.mark.slow) for name in MORE)])
def test_a_can_stays_in_the_hand_while_the_arm_turns(name: str, table_worlds, operator) -> None:
    model = combine("differential_base", "panda_arm", name)
    with DefaultRobot(model, table_worlds["can"], seed=3) as robot:
        hand = operator(robot)
        hand.grasp("can")
        assert hand.gripper.state().object_held
        assert hand.gripper.width() == pytest.approx(0.066, abs=0.001)
        gripped = hand.in_hand("can")
        hand.move_vertically(0.15)
        turned = hand.arm.positions() + np.array([0.5, 0, 0, 0, 0, 0, 0])
        hand.finish(hand.arm.move_to(turned, 0.4))
        slip = gripped.inverse() @ hand.in_hand("can")
        assert np.linalg.norm(slip.position) < 0.002
        assert _follower_error(robot) < 0.02
        judged = audit(robot.audit_record(), ALLOWED)
    assert judged.honest, judged.findings
    assert judged.max_penetration_mm < 1.5
    assert judged.joint_limit_violations == judged.velocity_limit_violations == 0


@pytest.mark.parametrize("name", ["xarm_gripper", "pr2_gripper"])
def test_fingers_on_linkages_close_on_nothing_and_open_again(name: str, empty_world) -> None:
    with DefaultRobot(combine("differential_base", "panda_arm", name), empty_world) as robot:
        gripper = robot.part("gripper", Gripper)
        _finish(robot, gripper.close())
        assert gripper.width() < 0.001
        assert gripper.state().empty
        _finish(robot, gripper.open())
        assert gripper.width() == pytest.approx(gripper.model.max_width, abs=0.001)


@pytest.mark.slow
def test_a_hand_of_sixteen_joints_makes_a_fist_and_opens(empty_world) -> None:
    with DefaultRobot(combine("differential_base", "panda_arm", "allegro_hand"), empty_world) as robot:
        truth, fingers = GroundTruth(robot), robot.part("gripper", JointGroup)
        start = truth.base_pose()
        for state in ("fist", "open"):
            wanted = robot.model.posture(state, fingers.joint_names)
            _finish(robot, fingers.move_to(wanted, 0.3))
            np.testing.assert_allclose(fingers.positions(), wanted, atol=0.01)
        assert np.linalg.norm(truth.base_pose().position - start.position) < 1e-4


def test_a_suction_cup_holds_with_as_much_of_its_force_as_its_vacuum_has_been_built_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And whenever it leaves the surface, the vacuum is gone."""
    parameters = SimulationParameters()
    cup = combine("differential_base", "panda_arm", "suction").of(GripperModel)["gripper"].part
    assert isinstance(cup, SuctionPart)
    pump, pushed, controls = SuctionPump(cup, parameters), [], []
    engine = SimpleNamespace(push=lambda body, link, force, point: pushed.append((body, link, force)))
    pump.attach(
        SimpleNamespace(
            reader=lambda purpose: None,
            actor=lambda: engine,
            built=SimpleNamespace(robot=1, links={cup.cup: 9}),
            effort_controls=controls,
        )
    )
    touched = (2, 0, (0.5, 0.0, 0.3), (0.0, 0.0, -1.0))
    monkeypatch.setattr(pump, "_touched", lambda: touched)
    pump.send(0.0, 40.0, 1.0)
    steps = round(BUILD_UP / parameters.time_step)
    for part in (1 / steps, 0.5, 1.0, 2.0):
        while len(pushed) < 2 * round(part * steps):
            controls[0]()
        (_, _, on_it), (_, _, on_cup) = pushed[-2:]
        assert on_it == pytest.approx((0.0, 0.0, 40.0 * min(1.0, part)), rel=0.05)
        assert on_cup == pytest.approx((0.0, 0.0, -on_it[2]))
    assert pump.read().object_held
    monkeypatch.setattr(pump, "_touched", lambda: None)
    controls[0]()
    assert not pump.read().object_held
    monkeypatch.setattr(pump, "_touched", lambda: touched)
    controls[0]()
    assert pushed[-1][2][2] == pytest.approx(-40.0 / steps, rel=0.05)


def _follower_error(robot: SimulatedRobot) -> float:
    simulation = robot.simulation
    joints = simulation.built.joints

    def position(name: str) -> float:
        return simulation.engine.joint_states(simulation.built.robot, [joints[name]])[0][0]

    followers = robot.model.of(GripperModel)["gripper"].followers
    return max((abs(position(f.joint) - f.multiplier * position(f.leader) - f.offset) for f in followers), default=0.0)


def _finish(robot: SimulatedRobot, motion) -> None:
    while not motion.done:
        robot.clock.sleep(0.05)
    assert motion.failure is None


class Picker:
    """Lowers a suction cup on the box of the table's world and lifts it."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, self.truth = robot, GroundTruth(robot)
        self.arm, self.cup = robot.part("arm", Arm), robot.part("gripper", Gripper)
        self.kinematics = DampedLeastSquares(robot.model)
        self.reference = robot.model.posture("home", self.arm.joint_names)

    def reach(self, height: float, speed: float, blocked: bool = False) -> None:
        box = self.truth.base_pose().inverse() @ self.truth.object_pose("box")
        place = Pose.from_xyz_rpy((box.position[0], box.position[1], height), (np.pi, 0.0, 0.0))
        self.reference = self.kinematics.solve(place, self.reference, np.random.default_rng(0)).best
        motion = self.arm.move_to(self.reference, speed)
        while not motion.done:
            self.robot.clock.sleep(0.05)
        assert blocked or motion.failure is None

    def pick(self) -> float:
        """How high the box is lifted, metres."""
        self.reach(TOP + 0.05, 0.4)
        _finish(self.robot, self.cup.close())
        assert self.cup.state().empty  # above the box it sucks air
        self.reach(TOP - 0.0005, 0.05, blocked=True)
        self.robot.clock.sleep(0.4)
        start = float(self.truth.object_pose("box").position[2])
        self.reach(TOP + 0.08, 0.1)
        return float(self.truth.object_pose("box").position[2]) - start


@pytest.mark.parametrize(("mass", "lifted"), [(0.3, True), (8.0, False)])
def test_a_cup_lifts_what_its_rated_force_bears_and_no_more(mass: float, lifted: bool, table_worlds) -> None:
    """50 N hold 0.3 kg (3 N) and not 8 kg (78 N)."""
    world = table_worlds["box"]
    heavy = dataclasses.replace(world.objects[0].model, mass=mass)
    world = dataclasses.replace(world, objects=(dataclasses.replace(world.objects[0], model=heavy),))
    with DefaultRobot(combine("differential_base", "panda_arm", "suction"), world, seed=1) as robot:
        picker = Picker(robot)
        height = picker.pick()
        assert (height > 0.06) is lifted
        assert picker.cup.state().object_held is lifted
        _finish(robot, picker.cup.open())
        robot.clock.sleep(0.5)
        assert not picker.cup.state().object_held
        assert picker.truth.object_pose("box").position[2] < 0.81
        judged = audit(robot.audit_record(), ALLOWED)
        without_support = audit(robot.audit_record(), [pair for pair in ALLOWED if "table" not in pair])
    assert judged.honest, judged.findings
    assert ("box", "table") in [(hit.first, hit.second) for hit in without_support.collisions]
