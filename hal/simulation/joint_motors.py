"""Joint drives as a channel: position motors that interpolate at the physics rate, torques, encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from typing_extensions import override

from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Sphere
from bestman_bt.robot_model.model import JointedModel
from hal.parts.channels import JointChannel, JointReading
from hal.simulation.guards import Reader
from hal.simulation.parameters import SimulationParameters
from hal.simulation.sensor_pipeline import EncoderReading, Encoders
from hal.simulation.simulation import SimulatedChannel, Simulation

if TYPE_CHECKING:
    import trimesh


def mass_distribution(parts: Sequence[PlacedShape], mass: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the centre of mass (3,) in the frame of the parts and the inertia (3, 3) about it, kg m², at uniform
    density.
    """
    import trimesh  # takes a third of a second, and only worlds with doors and drawers need it

    solids = [_solid(part) for part in parts]
    whole: Any = trimesh.util.concatenate(solids)
    whole.density = mass / sum(part.volume for part in solids)
    return np.asarray(whole.center_mass), np.asarray(whole.moment_inertia)


def _solid(part: PlacedShape) -> trimesh.Trimesh:
    import trimesh

    solid: trimesh.Trimesh
    match part.shape:
        case Box():
            solid = trimesh.creation.box(part.shape.size)
        case Cylinder():
            solid = trimesh.creation.cylinder(part.shape.radius, part.shape.length)
        case Sphere():
            solid = trimesh.creation.icosphere(radius=part.shape.radius)
        case _:
            solid = trimesh.Trimesh(part.shape.vertices, part.shape.faces).convex_hull
    solid.apply_transform(part.pose.matrix)
    return solid


# The true motion of frames on the robot, for simulated sensors alone: from how far they went since the last look.
# Bullet's own velocities of a robot's links leave out what position motors correct in a step: joints tell half their
# speed, and so do the links behind them.


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """The motion of a frame: ``pose`` in the map; ``linear`` (3,) m/s of its origin and ``angular`` (3,) rad/s along
    the map's axes.
    """

    pose: Pose
    linear: Array
    angular: Array

    def velocity_at(self, point: Array) -> Array:
        """Return the velocity (3,), m/s, of the body's point at ``point`` (3,), metres in the map frame."""
        velocity: Array = self.linear + np.cross(self.angular, point - self.pose.position)
        return velocity


class FrameTracker:
    """Tracks one frame or link of the robot; its velocity is zero until the second read."""

    def __init__(self, simulation: Simulation, reader: Reader, frame: str) -> None:
        self._simulation, self._reader, self._frame = simulation, reader, frame
        self._before: tuple[float, Pose] | None = None

    def look(self) -> FrameMotion:
        """Return the current pose of the frame, and its mean velocity since the last call."""
        pose, now = self._simulation.link_pose(self._reader, self._frame), self._simulation.now
        before, self._before = self._before, (now, pose)
        if before is None:
            return FrameMotion(pose, np.zeros(3), np.zeros(3))
        stamp, old = before
        turned = Rotation.from_quat(pose.quaternion) * Rotation.from_quat(old.quaternion).inv()
        return FrameMotion(pose, (pose.position - old.position) / (now - stamp), turned.as_rotvec() / (now - stamp))


def body_velocity_at(reader: Reader, body: int, link: int, point: Array) -> Array:
    """Return the velocity (3,), m/s, at ``point`` (3,) of the map, of a body without position motors: an object or a
    door.
    """
    if link >= 0:
        centre, linear, angular = map(np.array, reader.link_motions(body, [link])[0])
    else:
        centre = np.array(reader.body_pose(body)[0])
        linear, angular = map(np.array, reader.body_velocity(body))
    velocity: Array = linear + np.cross(angular, point - centre)
    return velocity


class JointMotors(SimulatedChannel, JointChannel):
    """The drives of one group of joints, and the ``encoders`` that programs read."""

    takes_efforts = True

    def __init__(
        self, name: str, model: JointedModel, parameters: SimulationParameters, rng: np.random.Generator
    ) -> None:
        self._model, self._parameters = model, parameters
        self.encoders = Encoders(name, model.part.encoders, parameters.step_rate, rng)
        self._indices: list[int] = []
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._sent_to: Array = np.zeros(0)
        self._step, self._steps_left = self._sent_to, 0  # of the physics, to the set-point
        self._torques: Array | None = None

    def attach(self, simulation: Simulation) -> None:
        """Hold the joints at their current positions."""
        super().attach(simulation)
        self._indices = simulation.joints(self._model.joint_names)
        self._slots = simulation.slots(self._model.joint_names)
        self.encoders.attach(simulation, lambda: EncoderReading(self._measured(0), self._measured(1)))
        self._torques, self._steps_left, self._sent_to = None, 0, self._measured(0)
        self._drive(self._sent_to, np.zeros_like(self._sent_to))
        simulation.effort_controls += (self._interpolate, self._apply_torques)

    @override
    def detach(self) -> None:
        super().detach()
        self.encoders.detach()

    def read(self) -> JointReading:
        """Return the readings of the drives' encoders."""
        return JointReading(*self.simulation.joint_states()[:, self._slots])

    def published(self) -> JointReading:
        """Return the encoder reading, with rate, latency, noise and faults.

        Raises NoDataError without a reading.
        """
        reading = self.encoders.read()
        return JointReading(reading.positions, reading.speeds, self.simulation.efforts()[self._slots])

    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point, reached by the next control period; drives interpolate between physics steps.

        Steps at the control rate would shake a held object out of the fingers.
        """
        if self._torques is not None:
            self._end_torques()
        self._steps_left = self._parameters.control_every
        self._step = (positions - self._sent_to) / self._steps_left
        self._sent_to = positions

    def exert(self, efforts: Array) -> None:
        """Apply torques from the next physics step."""
        simulation = self.simulation
        if self._torques is None:
            simulation.release(self._indices)
        self._torques, self._steps_left = efforts, 0
        simulation.torques[self._slots] = efforts

    def halt(self) -> None:
        """Brake with the drives' full efforts."""
        self._end_torques()
        efforts = self._model.effort.tolist()
        self.motors.turn(self.simulation.built.robot, self._indices, [0.0] * len(efforts), efforts)

    def _end_torques(self) -> None:
        self._torques = None
        self.simulation.torques[self._slots] = np.nan
        self._sent_to = self._measured(0)

    def _interpolate(self) -> None:
        if self._steps_left:
            self._steps_left -= 1
            self._drive(self._sent_to - self._steps_left * self._step, self._step * self._parameters.step_rate)

    def _apply_torques(self) -> None:
        if self._torques is not None:
            self.motors.exert(self._indices, self._torques)

    def _drive(self, position: Array, velocity: Array) -> None:
        efforts, gain = self._model.effort.tolist(), self._parameters.joint_gain
        self.motors.track(self._indices, position, velocity, efforts, gain)

    def _measured(self, row: int) -> Array:
        values: Array = self.simulation.joint_states()[row, self._slots]
        return values
