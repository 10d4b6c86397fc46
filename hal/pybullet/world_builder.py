"""Builds a drawn world and the robot in a physics server; the only place where bodies, poses and frictions are set."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

from bestman_bt.messages import GRAVITY, Box, PlacedShape, Pose
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    LeggedBaseModel,
    RobotModel,
    WheeledBaseModel,
)
from bestman_bt.robot_model.mounting import without_frame_links
from bestman_bt.scene.scene import PlacedFurniture, PlacedObject, Walker, World, wall_box
from hal.pybullet.body_urdf import SLIDES, Color, body_urdf, furniture_urdf, joint_name, walker_urdf
from hal.pybullet.client import PhysicsClient
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.simulation.bodies import BuiltWorld, SimulationError

WALL_COLOR: Color = (0.87, 0.87, 0.83, 1.0)
FLOOR_COLOR: Color = (0.62, 0.58, 0.53, 1.0)
FLOOR_SIZE = 30.0
# Without this flag a cylinder becomes a prism of 32 sides, 1 mm thicker all around.
BODY_FLAGS = ("URDF_USE_IMPLICIT_CYLINDER",)
FURNITURE_FLAGS = (*BODY_FLAGS, "URDF_USE_INERTIA_FROM_FILE")
OBJECT_FLAGS = (*BODY_FLAGS, "URDF_ENABLE_SLEEPING")
ROBOT_FLAGS = (*BODY_FLAGS, "URDF_USE_INERTIA_FROM_FILE")
ARMS_FLAGS = (*ROBOT_FLAGS, "URDF_USE_SELF_COLLISION")


def build_world(client: PhysicsClient, model: RobotModel, world: World, parameters: PhysicsParameters) -> BuiltWorld:
    """Fill an empty physics server. Raises SimulationError if pybullet cannot load a body."""
    client.setGravity(0.0, 0.0, -GRAVITY)
    client.setTimeStep(parameters.time_step)
    client.setPhysicsEngineParameter(numSolverIterations=parameters.solver_iterations, deterministicOverlappingPairs=1)
    with TemporaryDirectory() as name:
        folder = Path(name)
        floor = _floor(client, parameters)
        walls = {f"wall_{i}": _wall(client, f"wall_{i}", *wall_box(wall), folder) for i, wall in enumerate(world.walls)}
        furniture: dict[str, int] = {}
        articulations: dict[str, tuple[int, int]] = {}
        for piece in world.furniture:
            furniture[piece.name], joints_of_piece = _furniture(client, piece, folder)
            articulations |= joints_of_piece
        objects = {placed.name: _object(client, placed, parameters, folder) for placed in world.objects}
        walkers = {walker.name: _walker(client, walker, folder) for walker in world.walkers}
        urdf, frames = without_frame_links(model.urdf)
        # A robot without a base that drives is bolted to where it stands.
        flags = ARMS_FLAGS if len(model.arm_names) > 1 else ROBOT_FLAGS
        robot = _load(client, "robot", urdf, world.robot_start.to_pose(), folder, not model.of(BaseModel), flags)
    joints, links = _names(client, robot)
    _RobotSetup(client, parameters, robot, joints, links).set_up(model, world)
    described = {index: client.getJointInfo(robot, index) for index in joints.values()}
    built = BuiltWorld(
        floor,
        walls,
        furniture,
        objects,
        robot,
        joints,
        links,
        frames,
        parents={index: info[16] for index, info in described.items()},
        link_masses={index: client.getDynamicsInfo(robot, index)[0] for index in described},
        object_masses={body: client.getDynamicsInfo(body, -1)[0] for body in objects.values()},
        max_efforts={index: info[10] for index, info in described.items()},
        articulations=articulations,
        walkers=walkers,
    )
    if len(model.arm_names) > 1:
        _let_arms_collide(client, model, built)
    return built


def _let_arms_collide(client: PhysicsClient, model: RobotModel, built: BuiltWorld) -> None:
    """Let the links of two arms with their hands collide, except for pairs that the model excludes."""
    carriers: defaultdict[int, set[str]] = defaultdict(set)
    for name, arm in model.of(ArmModel).items():
        for link in (built.links.get(arm.base_frame), *built.below(arm.joint_names)):
            if link is not None:
                carriers[link].add(name)
    for (first, one), (second, other) in combinations(built.links.items(), 2):
        arms = carriers[one], carriers[other]
        collide = all(arms) and arms[0].isdisjoint(arms[1]) and {first, second} not in model.allowed_self_pairs
        client.setCollisionFilterPair(built.robot, built.robot, one, other, int(collide))


def _load(
    client: PhysicsClient,
    name: str,
    urdf: str,
    pose: Pose,
    folder: Path,
    fixed: bool,
    flags: tuple[str, ...] = BODY_FLAGS,
) -> int:
    file = folder / f"{name}.urdf"
    file.write_text(urdf, encoding="utf-8")
    try:
        body: int = client.loadURDF(
            str(file),
            pose.position.tolist(),
            pose.quaternion.tolist(),
            useFixedBase=fixed,
            flags=sum(getattr(pybullet, flag) for flag in flags),
        )
    except pybullet.error as error:
        raise SimulationError(f"pybullet cannot load {name!r}: {error}") from error
    return body


def _floor(client: PhysicsClient, parameters: PhysicsParameters) -> int:
    visual = client.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[FLOOR_SIZE / 2, FLOOR_SIZE / 2, 0.01],
        rgbaColor=FLOOR_COLOR,
        visualFramePosition=[0.0, 0.0, -0.01],
    )
    body: int = client.createMultiBody(0.0, client.createCollisionShape(pybullet.GEOM_PLANE), visual)
    client.changeDynamics(body, -1, lateralFriction=parameters.floor_friction)
    return body


def _wall(client: PhysicsClient, name: str, box: Box, pose: Pose, folder: Path) -> int:
    placed = PlacedShape(box, Pose())
    return _load(client, name, body_urdf(name, 0.0, [placed], [(placed, WALL_COLOR)]), pose, folder, fixed=True)


def _furniture(client: PhysicsClient, piece: PlacedFurniture, folder: Path) -> tuple[int, dict[str, tuple[int, int]]]:
    """Return a fixed piece with its doors and drawers open as in the scene; only the friction of their joints holds
    them.
    """
    model = piece.model
    urdf = furniture_urdf(piece.name, model)
    body = _load(client, piece.name, urdf, piece.pose, folder, fixed=True, flags=FURNITURE_FLAGS)
    client.changeDynamics(body, -1, lateralFriction=model.friction)
    joints, _ = _names(client, body)
    articulations = {}
    for articulation in model.articulations:
        joint = joints[joint_name(articulation)]
        client.changeDynamics(body, joint, lateralFriction=model.friction)
        client.resetJointState(body, joint, piece.open.get(articulation.name, 0.0))
        # A motor that wants speed 0 with a bounded effort is dry friction; pybullet's default one would hold them shut.
        client.setJointMotorControl2(
            body, joint, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=articulation.friction
        )
        articulations[f"{piece.name}/{articulation.name}"] = (body, joint)
    return body, articulations


def _object(client: PhysicsClient, placed: PlacedObject, parameters: PhysicsParameters, folder: Path) -> int:
    model = placed.model
    seen = [(part, (*color, 1.0)) for part, color in model.appearance]
    urdf = body_urdf(placed.name, model.mass, model.collision, seen)
    body = _load(client, placed.name, urdf, placed.pose, folder, fixed=False, flags=OBJECT_FLAGS)
    # Finger pads are soft and touch in a patch; points of contact alone let an object pivot in the hand.
    client.changeDynamics(
        body,
        -1,
        lateralFriction=model.friction,
        spinningFriction=parameters.object_spinning_friction,
        sleepThreshold=parameters.object_sleep_speed**2,
    )
    return body


def _walker(client: PhysicsClient, walker: Walker, folder: Path) -> tuple[int, tuple[int, int]]:
    """Return a walker where its round begins."""
    x, y = walker.route[0]
    pose = Pose.from_xyz_rpy((x, y, 0.0), (0.0, 0.0, 0.0))
    body = _load(client, walker.name, walker_urdf(walker), pose, folder, fixed=True)
    joints, _ = _names(client, body)
    return body, (joints[SLIDES[0]], joints[SLIDES[1]])


def _names(client: PhysicsClient, robot: int) -> tuple[dict[str, int], dict[str, int]]:
    joints: dict[str, int] = {}
    links: dict[str, int] = {client.getBodyInfo(robot)[0].decode(): -1}
    for index in range(client.getNumJoints(robot)):
        info = client.getJointInfo(robot, index)
        joints[info[1].decode()] = index
        links[info[12].decode()] = index
    return joints, links


@dataclass(frozen=True)
class _RobotSetup:
    """The robot's body in the physics server, whose frictions, start posture and finger gears are set."""

    client: PhysicsClient
    parameters: PhysicsParameters
    robot: int
    joints: dict[str, int]
    links: dict[str, int]

    def set_up(self, model: RobotModel, world: World) -> None:
        """Set up all parts of the robot."""
        self._set_up_feet(model)
        self._reset(next((model.postures[n] for n in self.parameters.initial_postures if n in model.postures), {}))
        for gripper in model.of(GripperModel).values():
            friction = gripper.part.friction if world.finger_friction is None else world.finger_friction
            self._set_up_gripper(gripper, friction)

    def _set_up_feet(self, model: RobotModel) -> None:
        client, robot = self.client, self.robot
        for wheeled in model.of(WheeledBaseModel).values():
            base = wheeled.part
            for link in base.caster_links:
                client.changeDynamics(robot, self.links[link], lateralFriction=self.parameters.caster_friction)
            for joint in base.wheel_joints:
                friction = self.parameters.wheel_friction if base.wheel_friction is None else base.wheel_friction
                client.changeDynamics(robot, self.joints[joint], lateralFriction=friction)
                # Without the anchor a locked wheel creeps: a swing of the arm moves the base by 7 mm and 1.8 degrees.
                client.changeDynamics(robot, self.joints[joint], frictionAnchor=1)
        for legged in model.of(LeggedBaseModel).values():
            for foot in legged.part.feet:
                client.changeDynamics(robot, self.links[foot], lateralFriction=legged.part.foot_friction)

    def _set_up_gripper(self, gripper: GripperModel, friction: float) -> None:
        client, robot, parameters = self.client, self.robot, self.parameters
        for link in gripper.part.finger_links:
            client.changeDynamics(
                robot,
                self.links[link],
                lateralFriction=friction,
                contactStiffness=parameters.finger_stiffness,
                contactDamping=parameters.finger_damping,
                # Soft pads resist twisting: without it a round object slowly pivots about the axis between the fingers.
                spinningFriction=parameters.finger_spinning_friction,
            )
            # Without the anchor a held object creeps and pivots by degrees while the base turns. The anchor's force is
            # bounded by friction like any other; the monitor tells if an object ever follows an open hand.
            client.changeDynamics(robot, self.links[link], frictionAnchor=1)
        self._reset(gripper.joint_positions(gripper.max_width))
        if len(gripper.part.joints) == 2:
            first, second = gripper.part.joints
            self._gear(MimicJoint(first, second), parameters.finger_gear_erp, parameters.finger_gear_force)
        for follower in gripper.followers:
            # PyBullet ignores <mimic>; its own motor at a follower would work against the gear.
            client.setJointMotorControl2(robot, self.joints[follower.joint], pybullet.VELOCITY_CONTROL, force=0.0)
            self._gear(follower, parameters.linkage_erp, parameters.linkage_force)

    def _reset(self, positions: Mapping[str, float]) -> None:
        for joint, position in positions.items():
            self.client.resetJointState(self.robot, self.joints[joint], position)

    def _gear(self, mimic: MimicJoint, erp: float, force: float) -> None:
        """Couple one joint of the robot to another of its joints, as teeth or a bar of a linkage would."""
        follower, leader = self.joints[mimic.joint], self.joints[mimic.leader]
        gear = self.client.createConstraint(
            self.robot, follower, self.robot, leader, pybullet.JOINT_GEAR, [1, 0, 0], [0, 0, 0], [0, 0, 0]
        )
        ratio, offset = -mimic.multiplier, mimic.offset
        self.client.changeConstraint(gear, gearRatio=ratio, relativePositionTarget=offset, erp=erp, maxForce=force)
