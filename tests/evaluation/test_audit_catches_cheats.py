"""One cheat per counter, done the way a cheat would do it; each is caught, and honest runs are not accused."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.extras import PYBULLET_HAS_WHEELS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.robot_model.urdf_tree import joints_above
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.api import Arm, MobileBase
from hal.pybullet.client import UNGUARDED_FUNCTIONS
from hal.pybullet.package import pybullet
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.guards import ReadPurpose

if not PYBULLET_HAS_WHEELS:
    pytest.skip("its cheats are calls of PyBullet, which has no wheels for this Python", allow_module_level=True)


@pytest.fixture
def robot() -> Iterator[PyBulletRobot]:
    with PyBulletRobot(load_robot_model("diff_panda"), draw_world(load_scene("kitchen"), 7), seed=7) as robot:
        robot.clock.sleep(0.1)
        yield robot


@pytest.fixture
def server(robot: PyBulletRobot) -> int:
    return robot.client.id


@pytest.fixture
def cup(robot: PyBulletRobot) -> int:
    return robot.simulation.built.objects["cup"]


@pytest.fixture
def judge(robot: PyBulletRobot) -> Callable[[], Audit]:
    def judge() -> Audit:
        robot.clock.sleep(0.3)
        return audit(robot.audit_record())

    return judge


def only(judged: Audit) -> set[str]:
    """The counters that are not zero."""
    document = judged.to_document()
    return {name for name, value in document.items() if isinstance(value, int) and value > 0}


def test_an_honest_run_is_not_accused(robot, judge) -> None:
    arm, base = robot.part("arm", Arm), robot.part("base", MobileBase)
    motions = [arm.move_to(robot.model.posture("home", arm.joint_names), 0.5), base.rotate(0.5)]
    while not all(motion.done for motion in motions):
        robot.clock.sleep(0.05)
    judged = judge()
    assert judged.honest
    assert only(judged) == set()
    assert judged.faults(0.002) == ()


def test_reading_the_truth_before_time_runs_is_evaluation_and_later_is_cheating(robot, judge) -> None:
    late = GroundTruth(robot)
    assert not late.trusted
    late.object_pose("cup")
    judged = judge()
    assert judged.ground_truth_reads == 1
    assert not judged.honest


def test_looking_at_the_drawn_world_during_a_run_is_counted(robot, judge) -> None:
    assert robot.world.objects
    assert judge().ground_truth_reads == 1


def test_a_view_of_the_truth_made_in_time_is_free() -> None:
    with PyBulletRobot(load_robot_model("diff_panda"), draw_world(load_scene("kitchen"), 7), seed=7) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(0.1)
        truth.object_pose("cup")
        truth.base_pose()
        assert truth.trusted
        assert audit(robot.audit_record()).ground_truth_reads == 0


def test_reading_poses_through_the_client_is_counted(robot, cup, judge) -> None:
    client = robot.client
    client.getBasePositionAndOrientation(cup)
    client.getLinkState(robot.simulation.built.robot, 3)
    client.getJointState(robot.simulation.built.robot, 3)  # an encoder: free
    assert judge().ground_truth_reads == 2


def test_reading_poses_through_the_engine_is_counted(robot, cup, judge) -> None:
    engine, built = robot.simulation.engine, robot.simulation.built
    engine.body_pose(cup)
    engine.contacts()
    engine.joint_states(built.robot, [3])  # an encoder: free
    engine.joint_states(body=built.walls["wall_0"], joints=[])
    assert judge().ground_truth_reads == 3


def test_motors_of_the_robot_that_are_driven_past_the_api_are_tampering(robot, server, judge) -> None:
    engine, body = robot.simulation.engine, robot.simulation.built.robot
    engine.track([3], np.zeros(1), np.zeros(1), [1.0], 0.1)
    engine.approach(3, 0.0, 0.1, 1.0)
    engine.turn(body, [3], [0.0], [1.0])
    engine.exert([3], np.zeros(1))
    robot.client.setJointMotorControl2(body, 3, pybullet.VELOCITY_CONTROL, targetVelocity=0.0)
    pybullet.applyExternalForce(body, -1, [0.0] * 3, [0.0] * 3, pybullet.WORLD_FRAME, physicsClientId=server)
    assert judge().tampering == 6


def test_whatever_is_not_known_to_be_harmless_is_counted(robot, cup, server, tmp_path, judge) -> None:
    pybullet.saveWorld(str(tmp_path / "world.py"), physicsClientId=server)
    log = pybullet.startStateLogging(
        pybullet.STATE_LOGGING_GENERIC_ROBOT, str(tmp_path / "states"), physicsClientId=server
    )
    pybullet.stopStateLogging(log, physicsClientId=server)
    pybullet.changeVisualShape(cup, -1, rgbaColor=[1.0, 0.0, 0.0, 1.0], physicsClientId=server)
    robot.client.getVisualShapeData(cup)
    robot.client.getQuaternionFromEuler([0.0, 0.0, 1.0])
    judged = judge()
    assert (judged.ground_truth_reads, judged.tampering) == (3, 2)


def test_a_physics_server_that_is_named_by_the_last_argument_is_watched(robot, cup, server, judge) -> None:
    pybullet.resetBaseVelocity(cup, [0.0] * 3, [0.0] * 3, server)
    pybullet.getBasePositionAndOrientation(cup, server)
    pybullet.setJointMotorControl2(
        robot.simulation.built.robot, 3, pybullet.VELOCITY_CONTROL, 0.0, 0.0, 1.0, 0.1, 0.1, 0.0, server
    )
    judged = judge()
    assert robot.simulation.ledger.counts["resets"] == 1
    assert (judged.ground_truth_reads, judged.tampering) == (1, 1)


def test_an_object_that_is_put_through_the_engine_is_counted(robot, cup, judge) -> None:
    robot.simulation.engine.put(cup, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
    judged = judge()
    assert robot.simulation.ledger.counts["resets"] == 1
    assert any("cup jumped" in finding for finding in judged.findings)


def test_reading_poses_past_the_client_is_counted(cup, server, judge) -> None:
    pybullet.getBasePositionAndOrientation(cup, physicsClientId=server)
    assert judge().ground_truth_reads == 1


def test_a_teleported_object_is_counted(robot, cup, judge) -> None:
    robot.client.resetBasePositionAndOrientation(cup, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0])
    judged = judge()
    assert judged.teleports >= 1
    assert any("cup jumped" in finding for finding in judged.findings)


def test_a_teleport_past_every_wrapper_is_seen_by_its_effect(robot, cup, server, judge) -> None:
    """Through a function that was taken from the module before any guard stood there."""
    hidden = _unguarded("resetBasePositionAndOrientation")
    hidden(cup, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], physicsClientId=server)
    judged = judge()
    assert robot.simulation.ledger.counts["resets"] == 0
    assert judged.teleports >= 1


def test_a_creeping_object_is_seen(robot, cup, server, judge) -> None:
    """Moved by 0.05 mm in each step: no jump is large, their sum is."""
    move, read = (
        _unguarded("resetBasePositionAndOrientation"),
        _unguarded("getBasePositionAndOrientation"),
    )
    for _ in range(60):
        position, quaternion = read(cup, physicsClientId=server)
        move(cup, np.add(position, [5e-5, 0.0, 0.0]).tolist(), quaternion, physicsClientId=server)
        robot.clock.sleep(robot.simulation.parameters.time_step)
    assert judge().teleports >= 1


def test_a_teleported_joint_is_seen(robot, server, judge) -> None:
    joint = robot.simulation.built.joints["panda_joint1"]
    hidden = _unguarded("resetJointState")
    hidden(robot.simulation.built.robot, joint, 0.5, physicsClientId=server)
    judged = judge()
    assert judged.teleports >= 1
    assert any("panda_joint1 jumped" in finding for finding in judged.findings)


def test_a_teleported_robot_is_seen(robot, server, judge) -> None:
    hidden = _unguarded("resetBasePositionAndOrientation")
    hidden(robot.simulation.built.robot, [0.5, 0.5, 0.2], [0.0, 0.0, 0.0, 1.0], physicsClientId=server)
    assert judge().teleports >= 1


def test_moved_furniture_is_seen(robot, server, judge) -> None:
    hidden = _unguarded("resetBasePositionAndOrientation")
    hidden(robot.simulation.built.furniture["table"], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], physicsClientId=server)
    judged = judge()
    assert any("table, which is fixed, has moved" in finding for finding in judged.findings)
    assert judged.teleports >= 1


def test_a_restored_state_is_seen(robot, judge) -> None:
    client = robot.client
    state = client.saveState()
    base = robot.part("base", MobileBase)
    motion = base.rotate(0.5)
    while not motion.done:
        robot.clock.sleep(0.05)
    client.restoreState(state)
    assert judge().teleports >= 1


def test_a_constraint_between_hand_and_object_is_counted(robot, cup, judge) -> None:
    built = robot.simulation.built
    _fix(robot.client.createConstraint, built.robot, built.links["panda_hand"], cup)
    assert judge().grasp_constraints == 1


def test_a_constraint_past_every_wrapper_is_seen(robot, cup, server, judge) -> None:
    built = robot.simulation.built
    hidden = _unguarded("createConstraint")
    _fix(lambda *a, **k: hidden(*a, **k, physicsClientId=server), built.robot, built.links["panda_hand"], cup)
    assert judge().grasp_constraints == 1


def test_a_constraint_of_the_robot_that_is_taken_away_past_every_wrapper_is_seen(robot, server, judge) -> None:
    """Its fingers are geared by one."""
    geared = pybullet.getConstraintUniqueId(0, physicsClientId=server)
    _unguarded("removeConstraint")(geared, physicsClientId=server)
    assert judge().grasp_constraints == 1


def test_an_object_that_follows_an_open_hand_is_seen(robot, cup, judge) -> None:
    """Fixed below the finger tips, the cup moves as the hand does, and nothing presses on it."""
    arm = robot.part("arm", Arm)
    motion = arm.move_to(robot.model.posture("home", arm.joint_names), 0.5)
    while not motion.done:
        robot.clock.sleep(0.05)
    built, client = robot.simulation.built, robot.client
    hand = client.getLinkState(built.robot, built.links["panda_hand"])
    below = pybullet.multiplyTransforms(hand[0], hand[1], [0.0, 0.0, 0.19], [0.0, 0.0, 0.0, 1.0])
    client.resetBasePositionAndOrientation(cup, *below)
    client.createConstraint(
        built.robot, built.links["panda_hand"], cup, -1, pybullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0.19], [0, 0, 0]
    )
    motion = robot.part("base", MobileBase).move_backward(0.1)
    while not motion.done:
        robot.clock.sleep(0.05)
    judged = judge()
    assert judged.object_follows_open_hand >= 1
    assert any("cup moved" in finding and "unpressed" in finding for finding in judged.findings)


def test_an_object_that_hangs_in_the_air_is_seen(robot, cup, server, judge) -> None:
    hidden, push = _unguarded("resetBasePositionAndOrientation"), _unguarded("applyExternalForce")
    hidden(cup, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], physicsClientId=server)
    for _ in range(240):
        push(cup, -1, [0.0, 0.0, 0.2 * 9.81], [0.0, 0.0, 0.0], pybullet.LINK_FRAME, physicsClientId=server)
        robot.clock.sleep(robot.simulation.parameters.time_step)
    judged = judge()
    assert judged.tampering >= 1
    assert any("does not fall" in finding for finding in judged.findings)


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("changeDynamics", {"bodyUniqueId": 2, "linkIndex": -1, "lateralFriction": 9.0}),
        ("setGravity", {"gravX": 0.0, "gravY": 0.0, "gravZ": -1.0}),
        ("setCollisionFilterPair", {"bodyUniqueIdA": 1, "bodyUniqueIdB": 2, "linkIndexA": -1, "linkIndexB": -1,
                                    "enableCollision": 0}),
        ("applyExternalForce", {"objectUniqueId": 2, "linkIndex": -1, "forceObj": [1, 0, 0], "posObj": [0, 0, 0],
                                "flags": pybullet.LINK_FRAME}),
    ],
)  # fmt: skip
def test_tampering_through_the_module_is_counted(function, arguments, server, judge) -> None:
    getattr(pybullet, function)(**arguments, physicsClientId=server)
    assert judge().tampering >= 1


def test_a_heavier_or_stickier_object_is_seen_whoever_made_it_so(robot, cup, server, judge) -> None:
    hidden = _unguarded("changeDynamics")
    hidden(cup, -1, mass=0.01, physicsClientId=server)
    judged = judge()
    assert judged.tampering >= 1
    assert any("of cup" in finding for finding in judged.findings)


def test_driving_into_a_wall_is_a_collision(robot, judge) -> None:
    base = robot.part("base", MobileBase)
    for _ in range(160):
        base.set_velocity(0.5, 0.0, 0.0)
        robot.clock.sleep(0.05)
    judged = judge()
    assert judged.collisions
    assert judged.honest
    assert judged.to_document()["collisions"] == len(judged.collisions)
    assert "collision of" in judged.faults(0.1)[0]


def test_deep_overlap_is_measured(robot, cup, server, judge) -> None:
    """The cup, pushed 1 cm into the table by a teleport."""
    read, hidden = (
        _unguarded("getBasePositionAndOrientation"),
        _unguarded("resetBasePositionAndOrientation"),
    )
    position, quaternion = read(cup, physicsClientId=server)
    hidden(cup, np.subtract(position, [0.0, 0.0, 0.01]).tolist(), quaternion, physicsClientId=server)
    judged = judge()
    assert judged.max_penetration_mm > 5.0
    assert set(judged.max_penetration_pair) == {"cup", "table"}
    assert "cup" in judged.faults(0.002)[-1]


def test_a_joint_beyond_its_limit_is_seen(robot, server, judge) -> None:
    built = robot.simulation.built
    hidden = _unguarded("resetJointState")
    hidden(built.robot, built.joints["panda_joint4"], 0.2, physicsClientId=server)
    assert judge().joint_limit_violations >= 1


def test_a_joint_beyond_its_speed_is_seen(robot, server, judge) -> None:
    built = robot.simulation.built
    hidden = _unguarded("setJointMotorControl2")
    hidden(
        built.robot, built.joints["panda_joint1"], pybullet.VELOCITY_CONTROL, targetVelocity=4.0, force=500.0,
        physicsClientId=server,
    )  # fmt: skip
    assert judge().velocity_limit_violations >= 1


def test_motors_driven_past_the_robotics_api_are_counted(robot, server, judge) -> None:
    built = robot.simulation.built
    pybullet.setJointMotorControl2(
        built.robot, built.joints["panda_joint1"], pybullet.VELOCITY_CONTROL, targetVelocity=0.1, physicsClientId=server
    )
    assert judge().tampering == 1


def test_pybullet_calls_beside_or_after_the_robot_are_not_counted(robot, judge) -> None:
    other = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0.0, 0.0, -1.0, physicsClientId=other)
        client = robot.client
        counted = only(judge())
        server = client.id
        robot.disconnect()
        assert pybullet.connect(pybullet.DIRECT) == server
        pybullet.setGravity(0.0, 0.0, -1.0, physicsClientId=server)
        pybullet.disconnect(physicsClientId=server)
    finally:
        pybullet.disconnect(physicsClientId=other)
    assert counted == set()
    assert client.ledger.counts["tampering"] == 0


def _unguarded(name: str) -> Callable:
    """The function as a cheat would have it who took it from the module before the simulation was imported."""
    return UNGUARDED_FUNCTIONS[name]


def _fix(create: Callable, robot: int, hand: int, body: int) -> None:
    create(robot, hand, body, -1, pybullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0.3], [0, 0, 0])


def test_a_monitor_that_was_switched_off_is_noticed(robot, cup, judge) -> None:
    robot.simulation.observers.clear()
    judged = judge()
    assert judged.tampering > 0
    assert not judged.honest
    assert any("missed" in finding and "observations" in finding for finding in judged.findings)


def test_a_reader_that_calls_itself_a_sensor_during_a_run_is_counted(robot, cup, judge) -> None:
    robot.simulation.reader(ReadPurpose.SENSOR).body_pose(cup)
    assert judge().ground_truth_reads == 1


def test_an_arm_that_drives_into_the_other_one_collides_with_the_robot_itself() -> None:
    model = load_robot_model("two_arms")
    with PyBulletRobot(model, draw_world(load_scene("two_things"), 1), seed=1) as robot:
        left, right = robot.part("left", Arm), robot.part("right", Arm)
        for turned in (0.0, 0.9):  # side by side, then the hands through each other
            motions = []
            for arm, sign in ((left, -1.0), (right, 1.0)):
                positions = model.posture("home", arm.joint_names)
                positions[0] += sign * turned
                motions.append(arm.move_to(positions, 0.4))
            while not all(motion.done for motion in motions):
                robot.clock.sleep(0.05)
            if not turned:
                assert audit(robot.audit_record()).collisions == ()
        (first, *_) = audit(robot.audit_record(), allowed_contacts=[("fingers", "robot")], declared=()).collisions
    sides = [{name for name, arm in model.of(ArmModel).items() if {*arm.joint_names} & joints_above(model, link)}
             for link in (first.first, first.second)]  # fmt: skip
    assert sorted(sides, key=sorted) == [{"left"}, {"right"}]
    assert first.why == "the robot collides with itself"
