"""A simulated robot: the Robotics API over one drawn world in a physics engine."""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.registry import SIMULATED_SENSORS
from bestman_bt.robot_model.model import (
    ArmModel,
    GripperModel,
    JointGroupModel,
    LeggedBaseModel,
    RobotModel,
    WheeledBaseModel,
)
from bestman_bt.robot_model.part_config import SuctionPart
from bestman_bt.robot_model.payload import payload
from bestman_bt.scene.scene import World
from hal.api import NotConnectedError, Robot
from hal.parts.black_box import StopRecorder
from hal.parts.channels import traces
from hal.parts.driven_base import Arrival, BaseTiming, DrivenBase
from hal.parts.gate import ToolLimits
from hal.parts.gripper import CommandedGripper
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup, Tracking
from hal.simulation.audit_record import AuditRecord, DisturbanceLog
from hal.simulation.base_drives import LEGS_CANNOT, LegDrive, WheelDrive
from hal.simulation.bodies import RefusedPartError, check_names
from hal.simulation.engine import Engine
from hal.simulation.finger_motors import FingerMotors
from hal.simulation.imu import SimulatedImu
from hal.simulation.joint_motors import JointMotors
from hal.simulation.monitor import AuditMonitor
from hal.simulation.parameters import SimulationParameters
from hal.simulation.sensor_pipeline import Encoders, SimulatedSensor
from hal.simulation.simulation import Simulation
from hal.simulation.suction import SuctionPump

Actuator = CommandedGripper | DrivenBase | StreamedJointGroup
Channel = FingerMotors | JointMotors | LegDrive | SuctionPump | WheelDrive
JOINTS = Tracking(latency=0.0)
"""Timing of joints: a reading shows the set-point of the previous control period."""
LEGS = BaseTiming(stop_time=0.08, arrival=Arrival(arrived=0.005))
"""Timing of a walking base: it needs almost half a second to put its feet down, and comes to rest less precisely than a
base on wheels.
"""


class SimulatedRobot(Robot):
    """A simulated robot. ``connect()`` rebuilds the world and simulates until it is at rest; the clock continues across
    connections.

    ``seed`` determines sensor noise and the calibration errors of odometry. Equal models, worlds, seeds and commands
    give bit-identical runs. A subclass creates its engine in ``build``.
    """

    engine_name: ClassVar[str]
    """For people."""
    parameters_class: ClassVar[type[SimulationParameters]] = SimulationParameters
    """Type of the constructor's ``parameters``."""
    render_object: ClassVar[Callable[..., NDArray[np.uint8]]]
    """Renders shapes on white, without a robot: ``hal.mujoco.renderer``, ``hal.pybullet.pictures``."""
    clock: SimulatedClock

    def __init__(
        self,
        model: RobotModel,
        world: World,
        *,
        gui: bool = False,
        seed: int = 0,
        parameters: SimulationParameters | None = None,
    ) -> None:
        self.model, self._world, self._gui, self._seed = model, world, gui, seed
        self._parameters = parameters or self.parameters_class()
        self.clock = SimulatedClock(self._parameters.time_step)
        self._simulation: Simulation | None = None
        self._monitor: AuditMonitor | None = None
        self._latch = StopLatch()
        self._lock = threading.RLock()
        self._channels: dict[str, Channel] = {}
        self._actuators: dict[str, Actuator] = {}
        self._sensors: dict[str, SimulatedSensor[Any]] = {}
        self._make_sensors()
        self._make_actuators()
        self.parts = MappingProxyType({**self._actuators, **self._sensors})
        self._recorder = StopRecorder(traces(self._actuators, self.clock.now), self.clock.now)

    @property
    def world(self) -> World:
        """Return the requested world with the true start poses; reads after the first step are counted."""
        if self._simulation is not None and self._simulation.ledger.truth_closed:
            self._simulation.ledger.note("truth_reads", f"{type(self).__name__}.world")
        return self._world

    def encoders(self, part: str) -> Encoders:
        """Return the encoders of a wheeled base, an arm or a group of joints.

        Raises KeyError for other parts.
        """
        channel = self._channels[part]
        if isinstance(channel, JointMotors | WheelDrive):
            return channel.encoders
        raise KeyError(part)

    @classmethod
    def refused_parts(cls, model: RobotModel) -> Mapping[str, str]:
        """Return the parts of a robot that this engine cannot simulate → reason; a robot with such a part is
        refused.
        """
        return {}

    @property
    def simulation(self) -> Simulation:
        """The running simulation, for monitors and ground truth; NotConnectedError without a connection."""
        if self._simulation is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._simulation

    @property
    def unsupported(self) -> Mapping[str, str]:
        """Return the unsupported features: those of legged bases."""
        return LEGS_CANNOT if self.model.of(LeggedBaseModel) else {}

    def audit_record(self) -> AuditRecord:
        """Return the monitor's record since the scene was built. Raises NotConnectedError."""
        if self._simulation is None or self._monitor is None:
            raise NotConnectedError("the robot is not connected: ask for its record before disconnect()")
        return self._monitor.record()

    def disturbance_log(self) -> DisturbanceLog:
        """Return the log in which interventions are reported to the monitor; a detached one after ``close_truth``."""
        if self._monitor is None or self.simulation.ledger.truth_closed:
            return DisturbanceLog()
        return self._monitor.disturbance_log

    def close_truth(self) -> None:
        """Close access to the ground truth: views opened later are counted. Raises NotConnectedError. The first step
        also closes it; a judged run closes it before its tree is loaded.
        """
        self.simulation.ledger.close_truth()

    @abstractmethod
    def build(self, model: RobotModel, world: World, gui: bool) -> Engine:
        """Return an engine with the world built in it, the robot in its start posture."""

    def connect(self) -> None:
        """Build the world and simulate until it is at rest; idempotent. A latched stop stays latched."""
        if self._simulation is not None:
            return
        check_names(self._world)
        for part, why in self.refused_parts(self.model).items():
            raise RefusedPartError(f"{self.model.name}: parts.{part} {why}")
        engine = self.build(self.model, self._world, self._gui)
        try:
            simulation = Simulation(engine, self.model, self._world, self._parameters)
            self._monitor = AuditMonitor(simulation, self._world)
            self._attach(simulation)
        except BaseException:
            self._detach_all()
            engine.close()
            raise
        simulation.epoch = self.clock.now()
        self._simulation = simulation
        self.clock.step = self._step
        self.clock.sleep(self._parameters.settle_time)
        self.clock.step = self._first_step

    def disconnect(self) -> None:
        """End motions and periodic calls and close the physics server; idempotent."""
        if self._simulation is None:
            return
        self._detach_all()
        self.clock.step = None
        self.clock.cancel_timers()
        self._simulation.close()
        self._simulation = None

    def stop(self) -> None:
        """Bring all parts to rest and latch the stop; thread-safe, effective immediately."""
        with self._lock:
            if self._latch.set():
                self._recorder.stopped("stop() was called")
            for part in self.parts.values():
                part.stop()

    def keep_black_box_in(self, folder: Path | None) -> None:
        """Set the folder of the black box. The record of a very recent stop is written incompletely, because time does
        not advance meanwhile.
        """
        self._recorder.keep_in(folder)

    @override
    def clear_stop(self) -> None:
        self._latch.clear()

    @property
    def stopped(self) -> bool:
        """Return whether the stop is latched."""
        return bool(self._latch)

    @override
    def diagnostics(self) -> dict[str, str]:
        texts = {
            "implementation": self.engine_name,
            "connected": "yes" if self._simulation is not None else "no",
            "stopped": "yes" if self._latch else "no",
            "time": f"{self.clock.now():.2f} s",
            "world": f"{self._world.scene}, seed {self._world.seed}",
        }
        if self._simulation is not None:
            counts = self._simulation.ledger.counts
            texts["honesty"] = ", ".join(f"{kind} {count}" for kind, count in sorted(counts.items())) or "clean"
        return texts

    def _attach(self, simulation: Simulation) -> None:
        """Attach the parts to the simulation's loop, which drives them as a connection's loop does on hardware."""
        for name, part in self._actuators.items():
            self._channels[name].attach(simulation)
            part.attach()
            simulation.controls.append(partial(part.cycle, self._parameters.control_period))
        simulation.controls.append(self._recorder.look)
        for sensor in self._sensors.values():
            sensor.attach(simulation)

    def _detach_all(self) -> None:
        for part in self._actuators.values():
            part.detach()
        for channel in self._channels.values():
            channel.detach()
        for sensor in self._sensors.values():
            sensor.detach()

    def _step(self) -> None:
        with self._lock:
            self.simulation.step()

    def _first_step(self) -> None:
        """Start the time under external control."""
        self.close_truth()
        self.clock.step = self._step
        self._step()

    def _generator(self, part: str) -> np.random.Generator:
        """Return the random generator of a part's noise; its own stream, so that one part's use does not change
        another's.
        """
        return np.random.default_rng([self._seed, crc32(part.encode())])

    def _make_sensors(self) -> None:
        sensors = SIMULATED_SENSORS.names()
        for name, part in self.model.parts.items():
            if (kind := self.model.kind(name)) in sensors:
                make: Callable[..., SimulatedSensor[Any]] = SIMULATED_SENSORS.resolve(kind)
                self._sensors[name] = make(name, part, self._generator(name))

    def _make_actuators(self) -> None:
        """Make the channel of each part that moves, and its law over it."""
        factories: Mapping[str, Callable[[str, Any], tuple[Channel, Actuator]]] = {
            "base": self._make_wheels,
            "legged_base": self._make_legs,
            "arm": self._make_arm,
            "gripper": self._make_gripper,
            "suction": self._make_suction,
            "joint_group": self._make_joints,
        }
        for name, part in self.model.parts.items():
            if (kind := self.model.kind(name)) in factories:
                self._channels[name], self._actuators[name] = factories[kind](name, part)

    def _make_wheels(self, name: str, model: WheeledBaseModel) -> tuple[Channel, Actuator]:
        wheels = WheelDrive(name, model, self._parameters, self._generator(name))
        return wheels, DrivenBase(name, model, wheels, self._latch)

    def _make_legs(self, name: str, model: LeggedBaseModel) -> tuple[Channel, Actuator]:
        imu = next(sensor for sensor in self._sensors.values() if isinstance(sensor, SimulatedImu))
        body = payload(self.model, model.part.root or "", self.model.postures.get("home"))
        legs = LegDrive(model, self._parameters, imu, body)
        return legs, DrivenBase(name, model, legs, self._latch, LEGS)

    def _make_arm(self, name: str, model: ArmModel) -> tuple[Channel, Actuator]:
        parameters, tool = self._parameters, ToolLimits(self.model, name, self.model.safety)
        motors = JointMotors(name, model, parameters, self._generator(name))
        tracking, period = replace(JOINTS, stream_reserve=parameters.stream_reserve), parameters.control_period
        return motors, StreamedArm(name, model, motors, self._latch, period, tool, tracking, self.clock.now)

    def _make_gripper(self, name: str, model: GripperModel) -> tuple[Channel, Actuator]:
        fingers = FingerMotors(model, self._parameters)
        return fingers, CommandedGripper(name, model, fingers, self._latch)

    def _make_suction(self, name: str, model: GripperModel) -> tuple[Channel, Actuator]:
        assert isinstance(model.part, SuctionPart)
        pump = SuctionPump(model.part, self._parameters)
        return pump, CommandedGripper(name, model, pump, self._latch)

    def _make_joints(self, name: str, model: JointGroupModel) -> tuple[Channel, Actuator]:
        motors = JointMotors(name, model, self._parameters, self._generator(name))
        return motors, StreamedJointGroup(name, model, motors, self._latch, self._parameters.control_period, JOINTS)
