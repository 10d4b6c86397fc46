"""A robot in PyBullet, and PyBullet as an engine of ``hal.simulation``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.pybullet.client import PhysicsClient, RawCallGuard
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.pictures import photo, projection_matrix, render_object, view_matrices
from hal.pybullet.world_builder import build_world
from hal.simulation.bodies import ContactPoint, JointStates, LinkMotion, Quaternion, Vector, Viewpoint
from hal.simulation.engine import Engine
from hal.simulation.robot import SimulatedRobot


class PyBulletRobot(SimulatedRobot):
    """See ``SimulatedRobot``; ``client``: pybullet's functions, for code that sets up or disturbs a world."""

    engine_name: ClassVar[str] = "PyBullet"
    parameters_class = PhysicsParameters
    render_object = staticmethod(render_object)
    _parameters: PhysicsParameters
    client: PhysicsClient

    def build(self, model: RobotModel, world: World, gui: bool) -> PyBulletEngine:
        """Start and fill a physics server. Raises SimulationError if it cannot be started."""
        self.client = PhysicsClient()
        return PyBulletEngine(self.client, model, world, self._parameters, gui)


Array = NDArray[np.float64]
DEFAULT_FILTER, EVERYTHING = 1, -1
NUDGE = 1e-4
"""Shift of the camera, metres, if TinyRenderer returns a black frame, as it does at rare poses."""
ATTEMPTS = 4
NOT_DRAWN = 0.01
"""Near clipping distance, metres. Objects closer than the camera's own ``near`` are visible and occlude, but have no
depth.
"""
FRICTIONS = (1, 7)
"""Indices of lateral and spinning friction in pybullet's dynamics info."""
ENGINE_KEYS = ("fixedTimeStep", "gravityAccelerationX", "gravityAccelerationY", "gravityAccelerationZ")


class PyBulletEngine(Engine):
    """A separate PyBullet server. ``client``: for programs that call pybullet's functions; calls are counted."""

    def __init__(
        self, client: PhysicsClient, model: RobotModel, world: World, parameters: PhysicsParameters, gui: bool = False
    ) -> None:
        self._velocity_gain = parameters.joint_velocity_gain
        self.client, self.ledger = client, client.ledger
        client.connect(gui)
        self._free = free = client.free()
        self._guard = RawCallGuard(client)
        try:
            self.built = build_world(free, model, world, parameters)
        except BaseException:
            client.disconnect()
            raise
        client.robot = self.built.robot
        self._names = {self.built.robot: "robot", **self.built.body_names}
        frames = {body: free.getDynamicsInfo(body, -1)[3:5] for body in self._names}
        self._inertial_from_root = {body: Pose(*map(np.array, frame)).inverse() for body, frame in frames.items()}
        self._guard.install()

    def step(self) -> None:
        """Simulate one step."""
        self._free.stepSimulation()

    def close(self) -> None:
        """Close the physics server."""
        self._guard.remove()
        self._free = self.client
        self.client.disconnect()

    @override
    def track(
        self, joints: Sequence[int], positions: Array, velocities: Array, efforts: Sequence[float], gain: float
    ) -> None:
        self._free.setJointMotorControlArray(
            self.built.robot,
            joints,
            pybullet.POSITION_CONTROL,
            targetPositions=positions.tolist(),
            targetVelocities=velocities.tolist(),
            forces=efforts,
            positionGains=[gain] * len(joints),
            velocityGains=[self._velocity_gain] * len(joints),
        )

    def approach(self, joint: int, position: float, speed: float, effort: float) -> None:
        """Drive one of Bullet's position motors with its default gains."""
        self._free.setJointMotorControl2(
            self.built.robot,
            joint,
            pybullet.POSITION_CONTROL,
            targetPosition=position,
            force=effort,
            maxVelocity=speed,
        )

    def turn(self, body: int, joints: Sequence[int], speeds: Sequence[float], efforts: Sequence[float]) -> None:
        """Drive Bullet's velocity motors."""
        self._free.setJointMotorControlArray(
            body, joints, pybullet.VELOCITY_CONTROL, targetVelocities=speeds, forces=efforts
        )

    def exert(self, joints: Sequence[int], efforts: Array) -> None:
        """Add torques to those of the motors."""
        self._free.setJointMotorControlArray(self.built.robot, joints, pybullet.TORQUE_CONTROL, forces=efforts.tolist())

    def push(self, body: int, link: int, force: Vector, point: Vector) -> None:
        """Apply the force for one step."""
        self._free.applyExternalForce(body, link, force, point, pybullet.WORLD_FRAME)

    def joint_states(self, body: int, joints: Sequence[int]) -> JointStates:
        """Return joint states, with reaction forces if enabled."""
        if not joints:
            return (), (), ()
        positions, velocities, _, efforts = zip(*self._free.getJointStates(body, joints), strict=True)
        return positions, velocities, efforts

    def body_pose(self, body: int) -> tuple[Vector, Quaternion]:
        """Return the pose of its centre of mass."""
        pose: tuple[Vector, Quaternion] = self._free.getBasePositionAndOrientation(body)
        return pose

    def body_velocity(self, body: int) -> tuple[Vector, Vector]:
        """Return the linear and angular velocity of the body's centre of mass, (3,) m/s and (3,) rad/s."""
        velocity: tuple[Vector, Vector] = self._free.getBaseVelocity(body)
        return velocity

    def link_pose(self, body: int, link: int) -> Pose:
        """Return the pose of a link's frame; Bullet returns the centre of mass for the root, and poses before the step
        for others.
        """
        if link >= 0:
            position, quaternion = self._free.getLinkState(body, link, computeForwardKinematics=1)[4:6]
            return Pose(np.array(position), np.array(quaternion))
        position, quaternion = self._free.getBasePositionAndOrientation(body)
        return Pose(np.array(position), np.array(quaternion)) @ self._inertial_from_root[body]

    def link_motions(self, body: int, links: Collection[int]) -> Sequence[LinkMotion]:
        """Return the motions of the links' centres of mass."""
        states = self._free.getLinkStates(body, list(links), computeLinkVelocity=1)
        return [LinkMotion(state[0], state[6], state[7]) for state in states]

    def contacts(
        self, body: int | None = None, link: int | None = None, other: int | None = None
    ) -> Sequence[ContactPoint]:
        """Return Bullet's contact points without their first field, a flag."""
        which = {"bodyA": body, "linkIndexA": link, "bodyB": other}
        found = self._free.getContactPoints(**{key: value for key, value in which.items() if value is not None})
        return [ContactPoint._make(point[1:]) for point in found]

    def gaps(self, body: int, other: int, within: float, link: int | None = None) -> Sequence[float]:
        """Return the distances between convex parts, metres."""
        which = {} if link is None else {"linkIndexB": link}
        return [point[8] for point in self._free.getClosestPoints(body, other, within, **which)]

    def cast_rays(self, starts: Array, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Cast the rays in one batch."""
        hits = self._free.rayTestBatch(starts.tolist(), ends.tolist(), numThreads=1)
        bodies, _, shares, _, _ = zip(*hits, strict=True)
        return np.array(bodies), np.array(shares)

    def depth_image(
        self, map_from_optical: Pose, intrinsics: CameraIntrinsics, near: float, far: float, without: int = -1
    ) -> tuple[NDArray[np.uint8], Array]:
        """Render with the software renderer."""
        k, nearest = intrinsics, min(near, NOT_DRAWN)
        rotation = map_from_optical.rotation
        forward, up = rotation[:, 2], -rotation[:, 1]
        for attempt in range(ATTEMPTS):
            eye = map_from_optical.position + attempt * NUDGE * forward
            image = self._free.getCameraImage(
                k.width,
                k.height,
                viewMatrix=pybullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist()),
                projectionMatrix=projection_matrix(k, nearest, far),
                shadow=0,
                renderer=pybullet.ER_TINY_RENDERER,
            )
            rgb = np.asarray(image[2], dtype=np.uint8).reshape(k.height, k.width, 4)[..., :3]
            buffer = np.asarray(image[3], dtype=np.float64).reshape(k.height, k.width)
            if rgb.any() or (buffer < 1.0).any():
                break
        depth = far * nearest / (far - (far - nearest) * buffer)
        shown = (buffer < 1.0) & (depth >= near)
        if without >= 0:
            shown &= np.asarray(image[4]).reshape(k.height, k.width) != without
        return rgb, np.where(shown, depth, 0.0)

    def photo(self, viewpoint: Viewpoint, width: int, height: int) -> NDArray[np.uint8]:
        """Render with the software renderer."""
        return photo(self._free, viewpoint, width, height)

    def segments(self, viewpoint: Viewpoint, width: int, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return body and link of each pixel, (H, W) each, by the software renderer."""
        image = self._free.getCameraImage(
            width,
            height,
            **view_matrices(viewpoint, width / height),
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        )
        mask = np.asarray(image[4], dtype=np.intp).reshape(height, width)
        return np.where(mask >= 0, mask & ((1 << 24) - 1), -1), np.where(mask >= 0, (mask >> 24) - 1, -1)

    def put(self, body: int, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Reset the pose, and wake sleeping bodies."""
        self._free.resetBasePositionAndOrientation(body, position, quaternion)
        self._free.resetBaseVelocity(body, [0.0] * 3, [0.0] * 3)
        self._free.changeDynamics(body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)

    def set_joint(self, body: int, joint: int, position: float) -> None:
        """Reset the joint to ``position``."""
        self._free.resetJointState(body, joint, position)

    def friction(self, body: int) -> tuple[float, float]:
        """Return the friction that Bullet stores."""
        values = self._free.getDynamicsInfo(body, -1)
        return values[FRICTIONS[0]], values[FRICTIONS[1]]

    def set_friction(self, body: int, sliding: float, spinning: float) -> None:
        """Set the friction, and refresh existing contacts, which Bullet keeps with the old one."""
        self._free.changeDynamics(body, -1, lateralFriction=sliding, spinningFriction=spinning)
        self.forget_contacts(body, -1)

    def forget_contacts(self, body: int, link: int) -> None:
        """Refresh the contacts of a link, by setting its unchanged collision filter."""
        self._free.setCollisionFilterGroupMask(body, link, DEFAULT_FILTER, EVERYTHING)

    def constraint_count(self) -> int:
        """Return the number of constraints, including gears of the robot."""
        count: int = self._free.getNumConstraints()
        return count

    def constants(self) -> Mapping[str, tuple[Any, ...]]:
        """Return gravity, time step, and the dynamics info of each link."""
        values = self._free.getPhysicsEngineParameters()
        constants: dict[str, tuple[Any, ...]] = {key: (values[key],) for key in ENGINE_KEYS}
        constants["the number of bodies"] = (self._free.getNumBodies(),)
        for body, name in self._names.items():
            for link in range(-1, self._free.getNumJoints(body)):
                place = name if link < 0 else f"{name}, link {link}"
                dynamics = self._free.getDynamicsInfo(body, link)
                constants[f"friction of {place}"] = tuple(dynamics[at] for at in FRICTIONS)
                rest = tuple(value for at, value in enumerate(dynamics) if at not in FRICTIONS)
                constants[f"mass or contact values of {place}"] = rest
        return constants
