"""A test rig for grasps: the panda hand on a gantry, in physics, over a drawn world.

Nothing but joint motors moves the hand, nothing but friction holds the object; truth is read to judge, never to grasp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.rgbd import RGBDSensor
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Mesh, ObjectModel, Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.view import View
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.scene import World
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import WorldModel
from hal.api import Arm, Camera, CommandRefusedError, Gripper, Motion, MotionStatus
from hal.pybullet.package import pybullet
from hal.pybullet.pictures import projection_matrix
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.simulation import Simulation

GANTRY = Path(__file__).with_name("gantry")
WRIST_FROM_TOOL = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (math.pi, 0.0, -math.pi / 2))
"""Turns of the hand on the gantry's last joint: see gantry_hand.yaml."""


@dataclass(frozen=True)
class GraspRigParameters:
    """Metres, seconds, newtons.

    ``force``: of each finger. ``approach_speed``, ``lift_speed``: shares of the gantry's 1 m/s.
    ``lift``: how high the object is lifted, ``hold``: for how long it is then held. It counts as held where its lowest
    point is ``min_height`` above the table afterwards and it moved by less than ``max_slip`` in the hand meanwhile.
    ``transit_height``: above the table, where the hand travels. ``settle``: rest before anything begins.
    """

    force: float = 30.0
    approach_speed: float = 0.2
    lift_speed: float = 0.25
    lift: float = 0.15
    hold: float = 2.0
    min_height: float = 0.10
    max_slip: float = 0.03
    transit_height: float = 0.45
    settle: float = 0.5


@dataclass(frozen=True)
class GraspOutcome:
    """What a grasp came to; ``why`` says in a few words what went wrong, empty after a success.

    ``height``: of the object's lowest point over the table after the hold, ``slip``: its way in the hand during it,
    ``width``: of the fingers around it, metres. ``contacts``: what the hand pressed on with more than 1 N until it had
    closed, without the object itself.
    """

    why: str
    height: float = 0.0
    slip: float = 0.0
    width: float = 0.0
    contacts: tuple[str, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the object was lifted and held."""
        return not self.why


class GraspRig:
    """One world with the hand in it; a context manager.

    ``table_height``: z of the surface that the objects stand on, true, for judging and for the height of travel.
    ``head``: where the head camera is; it looks along its x axis.
    """

    def __init__(
        self, world: World, table_height: float, head: Pose, parameters: GraspRigParameters | None = None
    ) -> None:
        self.parameters = parameters or GraspRigParameters()
        self.model = rig_model(head)
        self.gripper = self.model.of(GripperModel)["gripper"]
        self._world, self._table_height = world, table_height
        self._robot = PyBulletRobot(self.model, world, seed=world.seed)
        self._arm, self._hand = self._robot.part("arm", Arm), self._robot.part("gripper", Gripper)
        kinematics, joints = ForwardKinematics(self.model), JointStateSensor(self._robot.parts, self.model)
        nowhere = WorldModel(SemanticMap(np.zeros((0, 4)), {}))
        self._sensors = {
            name: RGBDSensor(self._robot.part(name, Camera), kinematics, joints, nowhere)
            for name in self.model.of(CameraPart)
        }

    def __enter__(self) -> GraspRig:
        self._robot.connect()
        self.truth, self.photographer = GroundTruth(self._robot), ScenePhotographer(self._robot)
        self._pybullet = self._robot.client.free()  # before time runs
        self._wait(self.parameters.settle)
        return self

    def __exit__(self, *_: object) -> None:
        self._robot.disconnect()

    @property
    def simulation(self) -> Simulation:
        """The running physics."""
        return self._robot.simulation

    @property
    def seconds(self) -> float:
        """Simulated time since the start."""
        return self._robot.clock.now()

    def audit(self) -> dict[str, int]:
        """How often this run cheated, by kind: an honest one has zeros."""
        record = self._robot.audit_record()
        counts = {
            "resets": record.resets,
            "constraints": record.constraints,
            "truth_reads": record.truth_reads,
            "tampering": record.tampering,
        }
        findings = {"jumps": record.jumps, "hidden_constraints": record.hidden_constraints, "changes": record.changes}
        return counts | {name: len(found) for name, found in findings.items()}

    def look(self, camera: str = "head_camera") -> View:
        """What a camera measures now, in the map frame; its place is known from the encoders."""
        return self._sensors[camera].capture().in_base

    def look_from(self, map_from_camera: Pose) -> View:
        """Bring the wrist camera to ``map_from_camera``, turned about its line of sight as the hand likes it, and look.

        Raises CommandRefusedError where that is out of reach.
        """
        camera_from_tool = self._sensors["wrist_camera"].base_from_camera().inverse() @ self._tool_pose()
        turns = (Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, k * math.pi / 2)) for k in range(4))
        ways = [map_from_camera @ turn @ camera_from_tool for turn in turns]
        # The hand is best where it hangs highest.
        self._travel(max(ways, key=lambda way: float(way.apply((0.0, 0.0, -0.1))[2])))
        return self.look("wrist_camera")

    def masks(self, camera: str = "head_camera") -> dict[str, NDArray[np.bool_]]:
        """Which pixels (H, W) of ``camera`` truly show each object: for judging."""
        model = self.model.of(CameraPart)[camera]
        pose, k = self._sensors[camera].base_from_camera(), model.intrinsics
        forward, up = pose.rotation[:, 2], -pose.rotation[:, 1]
        image = self._pybullet.getCameraImage(
            k.width,
            k.height,
            viewMatrix=pybullet.computeViewMatrix(pose.position, pose.position + forward, up),
            projectionMatrix=projection_matrix(k, model.near, model.far),
            renderer=pybullet.ER_TINY_RENDERER,
        )
        bodies = np.asarray(image[4]).reshape(k.height, k.width)
        return {name: bodies == body for name, body in self.simulation.built.objects.items()}

    def photograph(self, target: str) -> NDArray[np.uint8]:
        """A picture for people of the hand and the object, (H, W, 3)."""
        at = self.truth.object_pose(target).position
        eye = at + np.array([-0.55, -0.35, 0.30])
        return self.photographer.picture(
            Viewpoint(tuple(eye), tuple(at + np.array([0.0, 0.0, 0.05])), 45.0), 640, 480, 1
        )

    def grasp(self, candidate: GraspCandidate, target: str) -> GraspOutcome:
        """Carry ``candidate`` out and judge it; ``target``: the object that is to be lifted."""
        p, start = self.parameters, self.seconds
        try:
            self._finish(self._hand.move(candidate.opening))
            self._travel(candidate.pre_grasp)
            self._move(candidate.grasp, p.approach_speed)
        except CommandRefusedError as error:
            return GraspOutcome(f"out of reach: {error}")
        self._finish(self._hand.move(self.gripper.part.min_width, p.force))
        contacts, width = self._contacts_since(start, target), self._hand.width()
        high = candidate.grasp.position + np.array([0.0, 0.0, p.lift])
        self._move(Pose(high, candidate.grasp.quaternion), p.lift_speed)
        before = self._place_in_hand(target)
        self._wait(p.hold)
        slip = float(np.linalg.norm(self._place_in_hand(target) - before))
        height = self.lowest_point(target) - self._table_height
        if height < p.min_height:
            why = "fell during the hold" if slip > p.max_slip else "was not lifted"
            why = why if width > self.gripper.part.min_width + 0.002 else "nothing between the fingers"
        else:
            why = "slid in the hand" if slip > p.max_slip else ""
        return GraspOutcome(why, height, slip, width, contacts)

    def retreat(self) -> None:
        """Open the hand and take it out of the head camera's view."""
        self._finish(self._hand.open())
        self._rise()
        self._finish(self._arm.move_to(self.model.posture("home", self._arm.joint_names)))

    def lowest_point(self, name: str) -> float:
        """True height of the lowest point of an object, metres in the map frame."""
        return float(self.outline(name)[:, 2].min())

    def outline(self, name: str) -> NDArray[np.float64]:
        """Points on the true surface of an object, (N, 3) metres in the map frame."""
        model = next(placed.model for placed in self._world.objects if placed.name == name)
        return self.truth.object_pose(name).apply(_surface(model))

    def _contacts_since(self, start: float, target: str) -> tuple[str, ...]:
        incidents = [i for i in self._robot.audit_record().contacts if i.end >= start]
        return tuple(sorted({i.second for i in incidents if target not in (i.first, i.second)}))

    def _place_in_hand(self, name: str) -> NDArray[np.float64]:
        hand = self.truth.frame_pose("gantry_wrist")
        return hand.inverse().apply(self.truth.object_pose(name).position)

    def _tool_pose(self) -> Pose:
        positions = self._arm.positions()
        return Pose(positions[:3]) @ _turned(positions[3:]) @ WRIST_FROM_TOOL

    def _travel(self, target: Pose) -> None:
        """Up, across, and down to ``target``."""
        wanted = self._positions(target)
        above = wanted.copy()
        above[2] = max(wanted[2], self._table_height + self.parameters.transit_height)
        self._rise()
        self._finish(self._arm.move_to(above))
        self._finish(self._arm.move_to(wanted))

    def _rise(self) -> None:
        positions = self._arm.positions().copy()
        positions[2] = max(positions[2], self._table_height + self.parameters.transit_height)
        self._finish(self._arm.move_to(positions))

    def _move(self, target: Pose, speed: float) -> None:
        self._finish(self._arm.move_to(self._positions(target), speed))

    def _positions(self, map_from_tool: Pose) -> NDArray[np.float64]:
        """The joints' positions, (6,), for a pose of the tool; CommandRefusedError where it is out of reach."""
        positions = wrist_positions(map_from_tool, self.model.of(ArmModel)["arm"], self._arm.positions())
        if positions is None:
            raise CommandRefusedError(f"the gantry does not reach {map_from_tool}")
        return positions

    def _finish(self, motion: Motion[None]) -> None:
        while motion.status is MotionStatus.RUNNING:
            self._wait(1.0 / 60.0)

    def _wait(self, seconds: float) -> None:
        self._robot.clock.sleep(seconds)


def wrist_positions(
    map_from_tool: Pose, arm: ArmModel, near: NDArray[np.float64] | None = None
) -> NDArray[np.float64] | None:
    """The gantry's joint positions, (6,), for a pose of the tool: those nearest to ``near``; None out of its limits."""
    roll, pitch, yaw = (map_from_tool @ WRIST_FROM_TOOL.inverse()).roll_pitch_yaw
    ways = [np.array([*map_from_tool.position, yaw + turn, pitch, roll]) for turn in (0.0, -2 * math.pi, 2 * math.pi)]
    within = [way for way in ways if np.all((way >= arm.lower) & (way <= arm.upper))]
    if not within:
        return None
    start = np.zeros(6) if near is None else near
    return min(within, key=lambda way: float(np.abs(way - start)[3:].max()))


def rig_model(head: Pose) -> RobotModel:
    """Gantry, hand, wrist camera, and a head camera at ``head``."""
    changes = {
        "parts.arm.part": str(GANTRY / "gantry_part.yaml"),
        "parts.head_camera.xyz": head.position.tolist(),
        "parts.head_camera.rpy": list(head.roll_pitch_yaw),
    }
    return load_robot_model(GANTRY / "gantry_hand.yaml", changes)


@cache
def _surface(model: ObjectModel) -> NDArray[np.float64]:
    """Samples of the collision shapes' surface in the object frame, (N, 3) metres."""
    parts = [placed.pose.apply(sample_shape(placed.shape, 0.004)[0]) for placed in model.collision]
    corners = [placed.pose.apply(placed.shape.vertices) for placed in model.collision if isinstance(placed.shape, Mesh)]
    return np.concatenate([*parts, *corners])


def _turned(yaw_pitch_roll: NDArray[np.float64]) -> Pose:
    return Pose.from_xyz_rpy((0.0, 0.0, 0.0), yaw_pitch_roll[::-1])
