"""The world of the twins: one simulated robot that runs in real time, and its clients."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import RGBDImage
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.scene import World
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.parameters import SimulationParameters
from hal.simulation.robot import SimulatedRobot
from hal.twins.camera_render_process import CameraRenderProcess, WorldStateReader
from hal.twins.errors import TwinError
from hal.twins.machine_watch import MachineWatch

Result = TypeVar("Result")
DRIVE_RESERVE = 5.0
"""Acceleration limit of the drives, as a multiple of that in the robot file, to follow a controller without lag."""
LONGEST_DELAY = 0.25
"""Maximum seconds of the simulation behind real time; the excess is skipped and counted."""


class TwinWorld:
    """Steps a simulated robot in real time, in the thread that calls ``run()``; no other thread uses the physics.

    Protocol servers register functions in ``ticks``, called before each physics step with its length; they may use the
    robot's parts as any program does. Other threads submit work by ``post`` and ``call``. Set-points are applied at the
    physics rate: protocols send up to 500 per second. ``cameras``: whether images will be requested. ``watch``:
    monitors whether the machine keeps up. ``engine``: the driver that simulates.
    """

    def __init__(
        self,
        model: RobotModel,
        world: World,
        seed: int = 0,
        *,
        cameras: bool = False,
        engine: str = DEFAULT_SIMULATOR,
        parameters: SimulationParameters | None = None,
    ) -> None:
        simulated: type[SimulatedRobot] = DRIVERS.resolve(engine)
        parameters = parameters or simulated.parameters_class(control_every=1, stream_reserve=DRIVE_RESERVE)
        self.robot = simulated(model, world, seed=seed, parameters=parameters)
        self.ticks: list[Callable[[float], None]] = []
        self.watch = MachineWatch(lambda words: None)
        self.without_power: set[str] = set()  # arms whose flange powers no tool
        self._drawing = simulated, model, world, seed
        self._cameras = cameras
        self._truth: GroundTruth | None = None
        self._state_reader: WorldStateReader | None = None
        self._renderer: CameraRenderProcess | None = None
        self._work: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread: int | None = None

    @property
    def truth(self) -> GroundTruth:
        """Return the ground truth of this world, for the judge; created before the first step."""
        if self._truth is None:
            raise RuntimeError("the world does not run yet")
        return self._truth

    def now(self) -> float:
        """Return the simulated time, seconds; a few milliseconds behind real time."""
        return self.robot.clock.now()

    def post(self, work: Callable[[], None]) -> None:
        """Execute ``work`` in the world's thread before the next step; it must not raise."""
        self._work.put(work)

    def call(self, work: Callable[[], Result], timeout: float = 5.0) -> Result:
        """Execute ``work`` in the world's thread and return its result; raises its exception, or TimeoutError."""
        if threading.get_ident() == self._thread:
            return work()
        future: Future[Result] = Future()

        def do() -> None:
            try:
                future.set_result(work())
            except Exception as error:  # noqa: BLE001 - it belongs to the one who asked
                future.set_exception(error)

        self._work.put(do)
        return future.result(timeout)

    def photograph(self, camera: str, pack: Callable[[RGBDImage], Result]) -> tuple[Result, float]:
        """Return the result of ``pack``, a function of a module, for a camera's current image, and the wall time of the
        capture.

        Callable from any thread except the world's. Physics continues meanwhile: it takes about 0.2 s.
        """
        if self._state_reader is None or self._renderer is None:
            raise TwinError("this world has no cameras, or it is not running yet")
        state = self.call(self._state_reader.read)
        packed = self._renderer.render(camera, state, pack)
        lens = self._drawing[1].of(CameraPart)[camera].intrinsics
        self.watch.frame(camera, time.time() - state.wall_time, lens.width * lens.height)
        return packed, state.wall_time

    def run(self, ready: Callable[[], None]) -> None:
        """Build the world, call ``ready``, and step until ``close()``."""
        self._thread = threading.get_ident()
        try:
            if self._cameras:
                self._renderer = CameraRenderProcess(*self._drawing)
            with self.robot as robot:
                self._truth, self._state_reader = GroundTruth(robot), WorldStateReader(robot)
                if self._renderer is not None:
                    self._renderer.wait_until_ready()
                ready()
                self._step(robot.simulation.parameters.time_step)
        finally:
            if self._renderer is not None:
                self._renderer.close()

    def close(self) -> None:
        """End ``run()``; from any thread or a signal handler."""
        self._closing.set()

    def _step(self, step: float) -> None:
        due = time.monotonic()
        while not self._closing.is_set():
            while not self._work.empty():
                self._work.get()()
            for tick in self.ticks:
                tick(step)
            self.robot.clock.sleep(step)
            due = self._wait(due + step)
            self.watch.look()

    def _wait(self, due: float) -> float:
        """Wait until a step is due; give up what cannot be caught up with."""
        ahead = due - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        elif -ahead > LONGEST_DELAY:
            self.watch.given_up -= ahead
            return time.monotonic()
        return due
