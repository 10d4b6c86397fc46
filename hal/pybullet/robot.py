"""A robot in PyBullet: the Robotics API over one drawn world."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from types import MappingProxyType
from zlib import crc32

import numpy as np

from bestman_bt.robot_model import RobotModel, payload
from bestman_bt.scene import World
from hal.api import NotConnectedError, Part, Robot
from hal.parts.simulated_clock import SimulatedClock
from hal.pybullet.arm import SimulatedArm
from hal.pybullet.base import SimulatedBase
from hal.pybullet.battery import SimulatedBattery
from hal.pybullet.bumper import SimulatedBumper
from hal.pybullet.camera import SimulatedCamera
from hal.pybullet.client import PhysicsClient
from hal.pybullet.force_torque import SimulatedForceTorque
from hal.pybullet.gripper import SimulatedGripper
from hal.pybullet.honesty_record import HonestyRecord
from hal.pybullet.imu import SimulatedImu
from hal.pybullet.interference import Interference
from hal.pybullet.joint_group import SimulatedJointGroup
from hal.pybullet.legged_base import LEGS_CANNOT, SimulatedLeggedBase
from hal.pybullet.lidar import SimulatedLidar
from hal.pybullet.monitor import HonestyMonitor
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.raw_call_guard import RawCallGuard
from hal.pybullet.simulation import Simulation
from hal.pybullet.suction import SimulatedSuction
from hal.pybullet.tactile import SimulatedTactile

SimulatedPart = (
    SimulatedArm
    | SimulatedBase
    | SimulatedBattery
    | SimulatedBumper
    | SimulatedCamera
    | SimulatedForceTorque
    | SimulatedGripper
    | SimulatedImu
    | SimulatedJointGroup
    | SimulatedLeggedBase
    | SimulatedLidar
    | SimulatedSuction
    | SimulatedTactile
)


class PyBulletRobot(Robot):
    """A simulated robot. ``connect()`` builds the world anew and lets it settle; time goes on across connections.

    ``seed`` decides sensor noise and the calibration errors of odometry. Equal models, worlds, seeds and commands give
    bit-identical runs.
    """

    def __init__(
        self,
        model: RobotModel,
        world: World,
        *,
        gui: bool = False,
        seed: int = 0,
        parameters: PhysicsParameters | None = None,
    ) -> None:
        self._model, self._world, self._gui, self._seed = model, world, gui, seed
        self._parameters = parameters or PhysicsParameters()
        self._clock = SimulatedClock(self._parameters.time_step)
        self._simulation: Simulation | None = None
        self._monitor: HonestyMonitor | None = None
        self._guard: RawCallGuard | None = None
        self._stopped = False
        self._lock = threading.RLock()
        self._parts = MappingProxyType(self._make_parts())

    # Description

    @property
    def clock(self) -> SimulatedClock:
        """Simulated time."""
        return self._clock

    @property
    def model(self) -> RobotModel:
        """The robot model."""
        return self._model

    @property
    def world(self) -> World:
        """The world that was asked for, with the true poses at the start: reading it once time runs is counted."""
        if self._simulation is not None:
            self._simulation.client.note_truth_read("PyBulletRobot.world")
        return self._world

    @property
    def parts(self) -> Mapping[str, Part]:
        """All parts by name."""
        return self._parts

    @property
    def simulation(self) -> Simulation:
        """The running simulation, for monitors and ground truth; NotConnectedError without a connection."""
        if self._simulation is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._simulation

    @property
    def declared_missing(self) -> Mapping[str, str]:
        """Legs cannot do all that wheels can."""
        return LEGS_CANNOT if any(base.legs for base in self._model.bases.values()) else {}

    def honesty_record(self) -> HonestyRecord:
        """What the monitor has seen since the scene was built; NotConnectedError without a connection."""
        if self._simulation is None or self._monitor is None:
            raise NotConnectedError("the robot is not connected: ask for its record before disconnect()")
        return self._monitor.record()

    def interference(self) -> Interference:
        """Where somebody who interferes tells the monitor of it; once the truth is closed, nobody listens there."""
        if self._monitor is None or self.simulation.client.truth_closed:
            return Interference()
        return self._monitor.interference

    def close_truth(self) -> None:
        """Everybody who evaluates has a view of the truth: whoever opens one from now on is counted. NotConnectedError.

        The first step of time closes it, too; a judged run closes it before its tree is loaded.
        """
        self.simulation.client.close_truth()

    # Life

    def connect(self) -> None:
        """Build the world and let it settle; idempotent. A latched stop stays latched."""
        if self._simulation is not None:
            return
        client = PhysicsClient()
        client.connect(self._gui)
        try:
            simulation = Simulation(client, self._model, self._world, self._parameters)
            self._monitor = HonestyMonitor(simulation, self._world)
            for part in self._parts.values():
                part.attach(simulation)
        except BaseException:
            for part in self._parts.values():
                part.detach()
            client.disconnect()
            raise
        simulation.epoch = self._clock.now()
        self._simulation = simulation
        self._guard = RawCallGuard(client)
        self._guard.install()
        self._clock.step = self._step
        self._clock.sleep(self._parameters.settle_time)
        self._clock.step = self._first_step

    def disconnect(self) -> None:
        """End motions and periodic calls and close the physics server; idempotent."""
        if self._simulation is None:
            return
        for part in self._parts.values():
            part.detach()
        self._clock.step = None
        self._clock.cancel_timers()
        if self._guard is not None:
            self._guard.remove()
        self._simulation.client.disconnect()
        self._simulation = None

    def stop(self) -> None:
        """Bring all parts to rest and latch; safe from any thread, at once in effect."""
        with self._lock:
            self._stopped = True
            for part in self._parts.values():
                part.stop()

    def clear_stop(self) -> None:
        """Accept commands again; nothing moves by itself."""
        self._stopped = False

    @property
    def stopped(self) -> bool:
        """Whether the stop is latched."""
        return self._stopped

    def diagnostics(self) -> dict[str, str]:
        """Short texts by subject."""
        texts = {
            "implementation": "PyBullet",
            "connected": "yes" if self._simulation is not None else "no",
            "stopped": "yes" if self._stopped else "no",
            "time": f"{self._clock.now():.2f} s",
            "world": f"{self._world.scene}, seed {self._world.seed}",
        }
        if self._simulation is not None:
            counts = self._simulation.client.counts
            texts["honesty"] = ", ".join(f"{kind} {count}" for kind, count in sorted(counts.items())) or "clean"
        return texts

    # Private

    def _step(self) -> None:
        with self._lock:
            self.simulation.step()

    def _first_step(self) -> None:
        """Time begins to run under somebody's control."""
        self.close_truth()
        self._clock.step = self._step
        self._step()

    def _is_stopped(self) -> bool:
        return self._stopped

    def _generator(self, part: str) -> np.random.Generator:
        """Noise of a part; its own stream, so that one part's use does not change another's."""
        return np.random.default_rng([self._seed, crc32(part.encode())])

    def _make_parts(self) -> dict[str, SimulatedPart]:
        model, parameters, stopped = self._model, self._parameters, self._is_stopped
        parts: dict[str, SimulatedPart] = {}
        imus = {name: SimulatedImu(name, imu, self._generator(name)) for name, imu in model.imus.items()}
        for name, base in model.bases.items():
            if base.legs:
                body = payload(model, base.trunk_link, model.postures.get("home"))
                parts[name] = SimulatedLeggedBase(name, base, parameters, stopped, next(iter(imus.values())), body)
            else:
                parts[name] = SimulatedBase(name, base, parameters, stopped, self._generator(name))
        for name, arm in model.arms.items():
            parts[name] = SimulatedArm(name, arm, parameters, stopped, self._generator(name))
        for name, gripper in model.grippers.items():
            hand = SimulatedSuction if gripper.kind == "suction" else SimulatedGripper
            parts[name] = hand(name, gripper, parameters, stopped)
        for name, group in model.joint_groups.items():
            parts[name] = SimulatedJointGroup(name, group, parameters, stopped, self._generator(name))
        for name, camera in model.cameras.items():
            parts[name] = SimulatedCamera(name, camera, self._generator(name))
        for name, lidar in model.lidars.items():
            parts[name] = SimulatedLidar(name, lidar, self._generator(name))
        for name, sensor in model.force_torques.items():
            parts[name] = SimulatedForceTorque(name, sensor, self._generator(name))
        parts |= imus
        for name, pad in model.tactiles.items():
            parts[name] = SimulatedTactile(name, pad, self._generator(name))
        for name, bumper in model.bumpers.items():
            parts[name] = SimulatedBumper(name, bumper)
        for name, battery in model.batteries.items():
            parts[name] = SimulatedBattery(name, battery, self._generator(name))
        return parts
