"""Renders camera images of the twins' world in a separate process, because a frame takes longer than many physics
steps."""

from __future__ import annotations

import contextlib
import dataclasses
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from multiprocessing.connection import Connection
from typing import TypeVar

from bestman_bt.messages import RGBDImage
from bestman_bt.robot_model.model import BaseModel, GripperModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.scene import World
from hal.api import Camera
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot
from hal.twins.errors import TwinError

START_TIME = 60.0
FRAME_TIME = 10.0
REAL_TIME_PRIORITY = 1
"""Real-time priority, below that of the controllers; a real camera does not wait for the robot's computer either."""
Packed = TypeVar("Packed")
RawPose = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class WorldState:
    """The state of the world at ``stamp``, seconds: raw poses of bodies and positions of joints. ``wall_time``: the
    corresponding time of the machine, because the lag of simulated time varies.
    """

    stamp: float
    wall_time: float
    robot: RawPose
    joints: dict[str, float]
    objects: dict[str, RawPose]
    articulations: dict[str, float]


class WorldStateReader:
    """Reads states of a running simulation; constructed before the first step, used in the world's thread."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._built = robot.simulation.built
        self._reader = robot.simulation.reader(ReadPurpose.SENSOR)
        coupled = [gripper.joint_positions(gripper.max_width) for gripper in robot.model.of(GripperModel).values()]
        self._joints = list(dict.fromkeys(chain(robot.simulation.joint_names, *coupled)))

    def read(self) -> WorldState:
        """Return the current state; takes a few hundred microseconds."""
        built, reader, articulations = self._built, self._reader, self._built.articulations.items()
        pose, robot = reader.body_pose, built.robot
        indices = [built.joints[joint] for joint in self._joints]
        return WorldState(
            stamp=self._robot.clock.now(),
            wall_time=time.time(),
            robot=pose(robot),
            joints=dict(zip(self._joints, reader.joint_states(robot, indices)[0], strict=True)),
            objects={name: pose(body) for name, body in built.objects.items()},
            articulations={name: reader.joint_states(body, [joint])[0][0] for name, (body, joint) in articulations},
        )


class CameraRenderProcess:
    """Renders camera images in another process, which holds a copy of the world and sets it to a given state.

    It builds that copy in parallel with this process; ``wait_until_ready`` waits for it. Noise, lens and faults are
    those of the simulated camera. ``render`` is thread-safe; one frame is rendered at a time.
    """

    def __init__(self, simulated: type[SimulatedRobot], model: RobotModel, world: World, seed: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._wire, other = context.Pipe()
        self._lock = threading.Lock()
        self._process = context.Process(target=_work, args=(other, simulated, model, world, seed), daemon=True)
        self._process.start()
        other.close()

    def wait_until_ready(self) -> None:
        """Wait until ``render`` may be called. Raises TwinError if the process has ended or takes too long."""
        try:
            ready = self._wire.poll(START_TIME) and self._wire.recv() == "ready"
        except EOFError:
            ready = False
        if not ready:
            raise TwinError("the process that renders the cameras did not start")

    def render(self, camera: str, state: WorldState, pack: Callable[[RGBDImage], Packed]) -> Packed:
        """Return the result of ``pack`` for the image; it runs in the other process, which imports it by name.

        Raises LookupError for an unknown camera, TwinError if the process is gone.
        """
        with self._lock:
            try:
                self._wire.send((camera, state, pack))
                if not self._wire.poll(FRAME_TIME):
                    raise TwinError(f"no picture of {camera} within {FRAME_TIME:g} s")
                answer = self._wire.recv()
            except (OSError, EOFError) as error:
                raise TwinError("the camera render process has ended") from error
        if isinstance(answer, Exception):
            raise answer
        packed: Packed = answer
        return packed

    def close(self) -> None:
        """End the process; idempotent."""
        self._wire.close()
        self._process.join(2.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _work(wire: Connection, simulated: type[SimulatedRobot], model: RobotModel, world: World, seed: int) -> None:
    """Run the other process, at a lower priority than the controllers, until the connection ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # This process renders what it is told to at once; the latency is that of the twin that sends the picture.
    prompt = {name: dataclasses.replace(camera, latency=0.0) for name, camera in model.of(CameraPart).items()}
    model = dataclasses.replace(model, parts={**model.parts, **prompt})
    with simulated(model, world, seed=seed) as robot, contextlib.suppress(EOFError, OSError):
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REAL_TIME_PRIORITY))
        wire.send("ready")
        while True:
            wire.send(_picture(robot, *wire.recv()))


def _picture(
    robot: SimulatedRobot, camera: str, state: WorldState, pack: Callable[[RGBDImage], Packed]
) -> Packed | Exception:
    try:
        _put(robot, state)
        image = robot.part(camera, Camera).capture()
        return pack(dataclasses.replace(image, stamp=state.stamp))
    except Exception as error:  # noqa: BLE001 - it belongs to the one who asked
        return error


def _put(robot: SimulatedRobot, state: WorldState) -> None:
    """Set the poses of this copy, in which nothing moves by physics."""
    built, engine = robot.simulation.built, robot.simulation.engine
    if robot.model.of(BaseModel):
        engine.put(built.robot, *state.robot)
    for name, position in state.joints.items():
        engine.set_joint(built.robot, built.joints[name], position)
    for name, pose in state.objects.items():
        engine.put(built.objects[name], *pose)
    for name, position in state.articulations.items():
        engine.set_joint(*built.articulations[name], position)
