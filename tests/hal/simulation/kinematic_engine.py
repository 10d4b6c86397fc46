"""A fake engine without forces: joints are where motors want them, wheels roll exactly, and nothing ever touches.

It shows what ``hal.simulation`` asks of an engine, and that all above it works without PyBullet.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import CameraIntrinsics, Pose, Pose2D
from bestman_bt.robot_model.model import RobotModel, WheeledBaseModel
from bestman_bt.robot_model.urdf_elements import child_of
from bestman_bt.scene.scene import World
from hal.simulation.audit_record import CallCounter
from hal.simulation.base_drives import make_drives
from hal.simulation.bodies import BuiltWorld, ContactPoint, LinkMotion, SimulationError, Viewpoint
from hal.simulation.engine import Engine
from hal.simulation.robot import SimulatedRobot

FLOOR, ROBOT = 0, 1
FAR = 2.0
"""Metres from the lidar and the cameras to whatever they look at."""
STEP = 1 / 240
STILL, UPRIGHT = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


class KinematicEngine(Engine):
    """The robot stands alone on the floor; its joints are numbered as the URDF lists them, and carry the same links."""

    def __init__(self, model: RobotModel, world: World) -> None:
        self.ledger = CallCounter()
        self._kinematics, self._where = ForwardKinematics(model), world.robot_start
        joints = ET.fromstring(model.urdf).findall("joint")
        self._names = [str(joint.get("name")) for joint in joints]
        self._movable = [number for number, joint in enumerate(joints) if joint.get("type") != "fixed"]
        numbers = range(len(joints))
        self.built = BuiltWorld(
            floor=FLOOR,
            walls={},
            furniture={},
            objects={},
            robot=ROBOT,
            joints=dict(zip(self._names, numbers, strict=True)),
            links={model.base_frame: -1} | {child_of(joint): number for number, joint in enumerate(joints)},
            frames={},
            parents=dict.fromkeys(numbers, -1),
            link_masses=dict.fromkeys(numbers, 0.0),
            object_masses={},
            max_efforts=dict.fromkeys(numbers, 0.0),
        )
        self._link_names = {number: name for name, number in self.built.links.items()}
        posture = next(model.postures[name] for name in ("carry", "home") if name in model.postures)
        self._positions = np.array([posture.get(name, 0.0) for name in self._names])
        self._speeds, self._moved = np.zeros(len(joints)), np.zeros(len(joints))
        self._targets: dict[int, tuple[float, float]] = {}
        """Joint → where it goes, and how fast at most."""
        self._drives = []
        for base in model.of(WheeledBaseModel).values():
            wheels, steering = (
                [self.built.joints[name] for name in names]
                for names in (base.part.wheel_joints, base.part.steering_joints)
            )
            self._drives.append((make_drives(base, 0.0, np.random.default_rng(0))[0], wheels, steering))

    def step(self) -> None:
        """Each joint goes to its target, or on at its speed; the base rolls as its wheels turn."""
        before = self._positions.copy()
        self._positions += self._speeds * STEP
        for joint, (target, fastest) in self._targets.items():
            way = target - before[joint]
            self._positions[joint] = before[joint] + math.copysign(min(abs(way), fastest * STEP), way)
        moved = (self._positions - before) / STEP
        for drive, wheels, steering in self._drives:
            vx, vy, wz = drive.motion(moved[wheels], self._positions[steering])
            self._where = self._where @ Pose2D(vx * STEP, vy * STEP, wz * STEP)
        self._speeds = np.where([joint in self._targets for joint in range(len(moved))], 0.0, self._speeds)
        self._moved = moved

    def close(self) -> None:
        """Nothing is held."""

    def track(self, joints: Sequence[int], positions: Any, velocities: Any, efforts: Any, gain: float) -> None:
        """At once."""
        self._targets |= {joint: (float(at), math.inf) for joint, at in zip(joints, positions, strict=True)}

    def approach(self, joint: int, position: float, speed: float, effort: float) -> None:
        """At its speed."""
        self._targets[joint] = (position, speed)

    def turn(self, body: int, joints: Sequence[int], speeds: Sequence[float], efforts: Sequence[float]) -> None:
        """At once."""
        for joint, speed in zip(joints, speeds, strict=True):
            self._targets.pop(joint, None)
            self._speeds[joint] = speed

    def exert(self, joints: Sequence[int], efforts: Any) -> None:
        """Nothing weighs anything: efforts move nothing here."""

    def push(self, body: int, link: int, force: Any, point: Any) -> None:
        """As little as efforts."""

    def joint_states(self, body: int, joints: Sequence[int]) -> tuple[Any, Any, Any]:
        """Without efforts."""
        chosen = list(joints)
        return self._positions[chosen], self._moved[chosen], np.zeros(len(chosen))

    def body_pose(self, body: int) -> tuple[Any, Any]:
        """The robot's, or the floor's."""
        pose = self._where.to_pose() if body == ROBOT else Pose()
        return tuple(pose.position), tuple(pose.quaternion)

    def body_velocity(self, body: int) -> tuple[Any, Any]:
        """It stands, as far as anybody asks."""
        return STILL, STILL

    def link_pose(self, body: int, link: int) -> Pose:
        """By forward kinematics."""
        positions = {self._names[joint]: float(self._positions[joint]) for joint in self._movable}
        return self._where.to_pose() @ self._kinematics.pose(self._link_names[link], positions)

    def link_motions(self, body: int, links: Collection[int]) -> Sequence[LinkMotion]:
        """Their frames stand for their centres of mass."""
        return [LinkMotion(tuple(self.link_pose(body, link).position), STILL, STILL) for link in links]

    def contacts(
        self, body: int | None = None, link: int | None = None, other: int | None = None
    ) -> Sequence[ContactPoint]:
        """None."""
        return ()

    def gaps(self, body: int, other: int, within: float, link: int | None = None) -> Sequence[float]:
        """None."""
        return ()

    def cast_rays(self, starts: Any, ends: Any) -> tuple[Any, Any]:
        """Everything is ``FAR`` away."""
        return np.full(len(starts), FLOOR), FAR / np.linalg.norm(ends - starts, axis=1)

    def depth_image(
        self, map_from_optical: Pose, intrinsics: CameraIntrinsics, near: float, far: float, without: int = -1
    ) -> Any:
        """A grey wall, straight ahead."""
        size = intrinsics.height, intrinsics.width
        return np.full((*size, 3), 128, np.uint8), np.full(size, FAR)

    def photo(self, viewpoint: Viewpoint, width: int, height: int) -> Any:
        """Grey."""
        return np.full((height, width, 3), 128, np.uint8)

    def segments(self, viewpoint: Viewpoint, width: int, height: int) -> Any:
        """Nothing."""
        return np.full((height, width), -1), np.full((height, width), -1)

    def put(self, body: int, position: Any, quaternion: Any) -> None:
        """There are no objects."""
        raise SimulationError(f"there is no object {body}")

    def set_joint(self, body: int, joint: int, position: float) -> None:
        """Joints follow their commands alone."""
        raise SimulationError(f"joint {joint} follows its command")

    def friction(self, body: int) -> tuple[float, float]:
        """None."""
        return 0.0, 0.0

    def set_friction(self, body: int, sliding: float, spinning: float) -> None:
        """It would change nothing."""

    def constraint_count(self) -> int:
        """None."""
        return 0

    def constants(self) -> Mapping[str, tuple[Any, ...]]:
        """None."""
        return {}


class KinematicRobot(SimulatedRobot):
    """Any robot on wheels, or that stands fixed."""

    engine_name: ClassVar[str] = "kinematic"

    def build(self, model: RobotModel, world: World, gui: bool) -> KinematicEngine:
        """Without a window."""
        return KinematicEngine(model, world)
