"""The shipped robot: complete, loadable, level on its wheels, free of false self-collisions."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart
from hal.pybullet.package import pybullet

DECLARED_MASS = 60 + 2 * 2 + 2 * 0.5 + 8 + 3 + 0.8 + 0.072 + 0.06 + 17.96  # base to cameras, and the Panda

# The links of a Panda that can meet (shared planning problems): each must stay in the checks.
PANDA_PAIRS = [
    *itertools.product(["link0"], ["link3", "link4", "link5", "link6", "link7", "hand", "leftfinger", "rightfinger"]),
    *itertools.product(["link1"], ["link4", "link5", "link6", "link7", "hand", "leftfinger", "rightfinger"]),
    *itertools.product(["link2"], ["link5", "link6", "link7", "hand", "leftfinger", "rightfinger"]),
    *itertools.product(["link3"], ["link6", "link7", "hand", "leftfinger", "rightfinger"]),
    *itertools.product(["link4"], ["link7", "hand", "leftfinger", "rightfinger"]),
    *itertools.product(["link5", "link6"], ["hand", "leftfinger", "rightfinger"]),
    ("link7", "rightfinger"),
]


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture(scope="module")
def kinematics(robot: RobotModel) -> tuple[pin.Model, pin.GeometryModel]:
    model = pin.buildModelFromXML(robot.urdf)
    geometry = pin.buildGeomFromUrdfString(model, robot.urdf, pin.GeometryType.COLLISION)
    for shape in geometry.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry.buildConvexHull(True, "Qt")
            shape.geometry = shape.geometry.convex
    return model, geometry


def configuration(model: pin.Model, positions: dict[str, float]) -> np.ndarray:
    q = pin.neutral(model)
    for joint, position in positions.items():
        q[model.joints[model.getJointId(joint)].idx_q] = position
    return q


def frame_pose(model: pin.Model, q: np.ndarray, frame: str) -> pin.SE3:
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(frame)]


def test_it_has_every_part_that_skills_ask_for(robot: RobotModel) -> None:
    assert (list(robot.of(BaseModel)), list(robot.of(ArmModel)), list(robot.of(GripperModel))) == (
        ["base"],
        ["arm"],
        ["gripper"],
    )
    assert (list(robot.of(JointGroupModel)), list(robot.of(LidarPart))) == (["head"], ["lidar"])
    assert list(robot.of(CameraPart)) == ["head_camera", "wrist_camera"]  # skills use the first
    assert robot.hand_of == {"gripper": "arm"}
    assert robot.of(ArmModel)["arm"].joint_names == tuple(f"panda_joint{i}" for i in range(1, 8))
    assert {"carry", "home", "look"} <= set(robot.postures)


def test_every_name_in_the_model_is_in_the_urdf(robot: RobotModel) -> None:
    urdf = ET.fromstring(robot.urdf)
    links = {link.get("name") for link in urdf.findall("link")}
    joints = {joint.get("name") for joint in urdf.findall("joint")}
    base, arm, gripper = robot.of(BaseModel)["base"], robot.of(ArmModel)["arm"], robot.of(GripperModel)["gripper"]
    assert {robot.base_frame, base.frame, arm.base_frame, arm.tool_frame, gripper.hand_link} <= links
    assert {*gripper.part.finger_links, *base.part.caster_links} <= links
    frames = {camera.optical_frame for camera in robot.of(CameraPart).values()} | {robot.of(LidarPart)["lidar"].frame}
    assert frames <= links
    assert {
        *base.part.wheel_joints,
        *arm.joint_names,
        *gripper.part.joints,
        *robot.of(JointGroupModel)["head"].joint_names,
    } <= joints
    assert all(set(posture) <= joints for posture in robot.postures.values())
    assert all(pair <= links for pair in robot.allowed_self_pairs)


def test_names_in_the_urdf_are_unique(robot: RobotModel) -> None:
    urdf = ET.fromstring(robot.urdf)
    for tag in ("link", "joint"):
        names = [element.get("name") for element in urdf.findall(tag)]
        assert len(names) == len(set(names))


def test_every_link_has_a_mass_and_nothing_mimics(robot: RobotModel) -> None:
    urdf = ET.fromstring(robot.urdf)
    masses = [float(link.find("inertial/mass").get("value")) for link in urdf.findall("link")]
    assert min(masses) > 0
    assert sum(masses) == pytest.approx(DECLARED_MASS, abs=0.02)
    assert not list(urdf.iter("mimic"))


def test_meshes_are_absolute_files_of_the_installed_package(robot: RobotModel) -> None:
    meshes = [Path(mesh.get("filename")) for mesh in ET.fromstring(robot.urdf).iter("mesh")]
    assert meshes
    assert all(mesh.is_absolute() and mesh.is_file() and "pybullet_data" in mesh.parts for mesh in meshes)


def test_it_stands_level_with_most_of_its_weight_on_the_wheels(robot: RobotModel, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(robot.urdf)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(numSolverIterations=50, physicsClientId=client)
        floor = pybullet.createMultiBody(
            0,
            pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[5, 5, 0.5], physicsClientId=client),
            basePosition=[0, 0, -0.5],
            physicsClientId=client,
        )
        body = pybullet.loadURDF(
            str(path),
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        joints = range(pybullet.getNumJoints(body, physicsClientId=client))
        info = [pybullet.getJointInfo(body, joint, physicsClientId=client) for joint in joints]
        index = {entry[1].decode(): entry[0] for entry in info}
        link = {entry[12].decode(): entry[0] for entry in info}
        hold = {**robot.postures["carry"], "left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
        for joint, position in hold.items():
            pybullet.resetJointState(body, index[joint], position, physicsClientId=client)
            pybullet.setJointMotorControl2(
                body,
                index[joint],
                pybullet.POSITION_CONTROL,
                targetPosition=position,
                force=float(info[index[joint]][10]),
                physicsClientId=client,
            )
        for _ in range(120):
            pybullet.stepSimulation(physicsClientId=client)
        position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        load = {
            name: sum(c[9] for c in pybullet.getContactPoints(body, floor, number, physicsClientId=client))
            for name, number in link.items()
        }
    finally:
        pybullet.disconnect(client)
    roll, pitch, yaw = pybullet.getEulerFromQuaternion(quaternion)
    assert max(abs(roll), abs(pitch), abs(yaw)) < np.radians(0.1)
    assert max(abs(position[0]), abs(position[1])) < 2e-3
    weight = 9.81 * DECLARED_MASS
    assert sum(load.values()) == pytest.approx(weight, rel=0.02)
    assert load["left_wheel"] > 0.35 * weight
    assert load["right_wheel"] > 0.35 * weight
    assert {name for name, newtons in load.items() if newtons > 0} <= {
        "left_wheel",
        "right_wheel",
        "front_caster",
        "rear_caster",
    }


def test_the_footprint_holds_chassis_and_wheels_and_no_more(robot: RobotModel) -> None:
    corners = np.array(robot.of(BaseModel)["base"].footprint)
    assert (corners[:, 0].min(), corners[:, 0].max()) == pytest.approx((-0.28, 0.28))
    assert (corners[:, 1].min(), corners[:, 1].max()) == pytest.approx((-0.26, 0.26))
    after = np.roll(corners, -1, axis=0)
    area = 0.5 * float(np.sum(corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]))
    assert 0.56 * 0.44 < area < 0.56 * 0.52  # positive: counter-clockwise


def test_the_tool_frame_looks_out_of_the_hand_and_closes_along_y(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, _ = kinematics
    gripper, tool_frame = robot.of(GripperModel)["gripper"], robot.of(ArmModel)["arm"].tool_frame
    fingers = dict.fromkeys(gripper.part.joints, gripper.max_width / 2)
    q = configuration(model, {**robot.postures["home"], **fingers})
    tool = frame_pose(model, q, tool_frame)
    hand = tool.actInv(frame_pose(model, q, gripper.hand_link))
    np.testing.assert_allclose(hand.rotation, np.eye(3), atol=1e-9)
    assert hand.translation[2] < -gripper.part.finger_depth
    left, right = (tool.actInv(frame_pose(model, q, link)).translation for link in gripper.part.finger_links)
    np.testing.assert_allclose(left - right, [0.0, gripper.max_width, 0.0], atol=1e-9)


def test_the_wrist_camera_sees_the_finger_tips_and_stays_behind_the_palm(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, geometry = kinematics
    q = configuration(model, robot.postures["carry"])
    camera = robot.of(CameraPart)["wrist_camera"]
    hand_from_camera = frame_pose(model, q, "panda_hand").actInv(frame_pose(model, q, camera.optical_frame))
    lens = camera.intrinsics
    for finger_y in (-0.04, 0.0, 0.04):
        x, y, z = hand_from_camera.actInv(np.array([0.0, finger_y, 0.105]))
        assert z > camera.near
        assert 0 < lens.fx * x / z + lens.cx < lens.width
        assert 0 < lens.fy * y / z + lens.cy < lens.height
    body = next(shape for shape in geometry.geometryObjects if shape.name.startswith("wrist_camera_link"))
    half = np.array(body.geometry.halfSide)
    corners = np.array(list(itertools.product(*[(-h, h) for h in half]))).T
    hand_from_body = frame_pose(model, q, "panda_hand").actInv(frame_pose(model, q, "wrist_camera_link"))
    corners[0] -= half[0]  # the link lies in the middle of the front face
    in_hand = hand_from_body.rotation @ corners + hand_from_body.translation[:, None]
    assert in_hand[2].max() < 0.0584  # where the fingers begin
    assert np.abs(in_hand[0]).min() > 0.032  # beside the hand's housing
    assert np.abs(in_hand[0]).max() < 0.075


def test_the_camera_looks_down_ahead_by_default(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, _ = kinematics
    camera = frame_pose(
        model, configuration(model, robot.postures["carry"]), robot.of(CameraPart)["head_camera"].optical_frame
    )
    down = np.radians(47.0)
    np.testing.assert_allclose(camera.rotation[:, 2], [np.cos(down), 0.0, -np.sin(down)], atol=1e-6)
    np.testing.assert_allclose(camera.rotation[:, 0], [0.0, -1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(camera.translation, [-0.2, 0.0, 1.65], atol=0.02)


def test_the_urdfs_joint_limits_are_the_models(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, _ = kinematics
    for group in (robot.of(ArmModel)["arm"], robot.of(JointGroupModel)["head"]):
        for i, name in enumerate(group.joint_names):
            joint = model.joints[model.getJointId(name)]
            assert model.lowerPositionLimit[joint.idx_q] == pytest.approx(group.lower[i])
            assert model.upperPositionLimit[joint.idx_q] == pytest.approx(group.upper[i])
            assert model.velocityLimit[joint.idx_v] == pytest.approx(group.velocity[i])


@pytest.mark.parametrize("pair", PANDA_PAIRS, ids="-".join)
def test_panda_links_that_can_meet_stay_in_the_checks(robot: RobotModel, pair: tuple[str, str]) -> None:
    assert frozenset(f"panda_{name}" for name in pair) not in robot.allowed_self_pairs


def checked_pairs(robot: RobotModel, model: pin.Model, geometry: pin.GeometryModel) -> pin.GeometryModel:
    checked = pin.GeometryModel(geometry)
    link = [model.frames[shape.parentFrame].name for shape in checked.geometryObjects]
    for i, j in itertools.combinations(range(len(link)), 2):
        if link[i] != link[j] and frozenset((link[i], link[j])) not in robot.allowed_self_pairs:
            checked.addCollisionPair(pin.CollisionPair(i, j))
    return checked


def test_no_posture_collides_with_the_robot_itself(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, geometry = kinematics
    checked = checked_pairs(robot, model, geometry)
    data, geometry_data = model.createData(), pin.GeometryData(checked)
    for posture in robot.postures.values():
        q = configuration(model, dict(posture))
        assert not pin.computeCollisions(model, data, checked, geometry_data, q, False)


def test_every_checked_pair_is_free_in_some_configuration(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, geometry = kinematics
    checked = checked_pairs(robot, model, geometry)
    data, geometry_data = model.createData(), pin.GeometryData(checked)
    generator = np.random.default_rng(0)
    always = np.ones(len(checked.collisionPairs), dtype=bool)
    arm, head = robot.of(ArmModel)["arm"], robot.of(JointGroupModel)["head"]
    for _ in range(50):
        positions = {
            name: generator.uniform(group.lower[i], group.upper[i])
            for group in (arm, head)
            for i, name in enumerate(group.joint_names)
        }
        pin.computeCollisions(model, data, checked, geometry_data, configuration(model, positions), False)
        always &= [result.isCollision() for result in geometry_data.collisionResults]
    assert not always.any()


def test_allowed_pairs_of_the_head_really_never_meet(
    robot: RobotModel, kinematics: tuple[pin.Model, pin.GeometryModel]
) -> None:
    model, geometry = kinematics
    declared = pin.GeometryModel(geometry)
    link = [model.frames[shape.parentFrame].name for shape in declared.geometryObjects]
    for i, j in itertools.combinations(range(len(link)), 2):
        if {link[i], link[j]} in ({"mast_link", "head_camera_link"}, {"base_link", "head_camera_link"}):
            declared.addCollisionPair(pin.CollisionPair(i, j))
    assert len(declared.collisionPairs) == 2
    data, geometry_data, head = model.createData(), pin.GeometryData(declared), robot.of(JointGroupModel)["head"]
    for pan, tilt in itertools.product(*(np.linspace(head.lower[i], head.upper[i], 15) for i in range(2))):
        q = configuration(model, dict(zip(head.joint_names, (pan, tilt), strict=True)))
        assert not pin.computeCollisions(model, data, declared, geometry_data, q, False)


def test_composing_twice_gives_the_same_robot(robot: RobotModel) -> None:
    again = load_robot_model("diff_panda")
    assert again.urdf == robot.urdf
    assert again.allowed_self_pairs == robot.allowed_self_pairs


def test_parts_are_there_by_name_and_by_kind(robot: RobotModel) -> None:
    assert robot.parts["arm"] is robot.of(ArmModel)["arm"]
    assert robot.of(LidarPart) == robot.of(LidarPart)
    assert robot.of(ArmModel) == robot.of(ArmModel)
    assert robot.of(GripperModel) == robot.of(GripperModel)
    assert list(robot.parts) == list(robot.parts)
