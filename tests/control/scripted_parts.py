"""Parts of a robot without physics: they do at once, or as a script says, what controllers tell them, and note it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory, LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.robot_model.model import BaseModel
from hal.api import Arm, Gripper, GripperState, Lidar, MobileBase, Motion, MotionErrorCode, RobotStoppedError
from hal.parts.simulated_clock import SimulatedClock
from tests.robot_models import arm_model, base_model, gripper_model

CORNERS = ((0.28, -0.26), (0.28, 0.26), (-0.28, 0.26), (-0.28, -0.26))
BASE = base_model(CORNERS)


def stepped_clock(step: Callable[[], None] = lambda: None, time_step: float = 0.0125) -> SimulatedClock:
    """A clock that calls ``step`` every ``time_step`` seconds of a sleep."""
    clock = SimulatedClock(time_step)
    clock.step = step
    return clock


class ScriptedMotion(Motion[None]):
    """Runs until somebody ends it; cancels are counted."""

    def __init__(self) -> None:
        super().__init__("", self._count)
        self.cancels = 0

    def _count(self) -> None:
        self.cancels += 1


class ScriptedBase(MobileBase):
    """A base that keeps to its acceleration, and whose commands lapse; ``true_pose`` is where it stands.

    Its odometry begins at ``odometry_start``, wherever it stands. ``error``: raised by each command and reading.
    ``refuses``: by commands alone. ``held``: it is told what it likes and does not move.
    """

    def __init__(self, true_pose: Pose2D, odometry_start: Pose2D, model: BaseModel = BASE) -> None:
        super().__init__("base")
        self._model = model
        self.clock = stepped_clock(self._step)
        self.true_pose, self._odometry = true_pose, odometry_start
        self.speed = np.zeros(3)
        self._wanted, self._lapses = np.zeros(3), 0.0
        self.told: list[Twist2D] = []
        self.stops = 0
        self.error: Exception | None = None
        self.refuses = self.held = False

    @property
    def model(self) -> BaseModel:
        return self._model

    @property
    def command_timeout(self) -> float:
        return 0.5

    def odometry(self) -> Pose2D:
        self._check()
        return self._odometry

    def velocity(self) -> Twist2D:
        self._check()
        return Twist2D(*self.speed.tolist())

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        self._check()
        if self.refuses:
            raise RobotStoppedError("the robot is stopped")
        self.told.append(Twist2D(vx, vy, wz))
        self._wanted, self._lapses = np.array([vx, vy, wz]), self.clock.now() + self.command_timeout

    def stop(self) -> None:
        self.stops += 1
        self._check()
        self._wanted = np.zeros(3)

    def move_forward(self, distance: float) -> Motion:
        raise NotImplementedError  # no test calls it

    def move_backward(self, distance: float) -> Motion:
        raise NotImplementedError  # no test calls it

    def rotate(self, angle: float) -> Motion:
        raise NotImplementedError  # no test calls it

    def _check(self) -> None:
        if self.error is not None:
            raise self.error

    def _step(self) -> None:
        dt, d = self.clock.time_step, self._model.part
        wanted = self._wanted if self.clock.now() < self._lapses else np.zeros(3)
        most = 2.0 * dt * np.array([d.max_acceleration, d.max_acceleration, d.max_angular_acceleration])
        self.speed = self.speed + np.clip(wanted - self.speed, -most, most)
        if self.held:
            self.speed = np.zeros(3)
        moved = Pose2D(*(self.speed * dt).tolist())
        self.true_pose, self._odometry = self.true_pose @ moved, self._odometry @ moved


class RoomLidar(Lidar):
    """Sees ``segments`` (N, 4) from where it is on a base; ``error``: raised instead. ``scans``: how many were read."""

    BEAMS = 180

    def __init__(self, base: ScriptedBase, base_from_lidar: Pose2D, segments: ArrayLike) -> None:
        super().__init__("lidar")
        self._base, self.base_from_lidar, self.segments = base, base_from_lidar, np.asarray(segments, float)
        self.error: Exception | None = None
        self.scans = 0

    @property
    def frame(self) -> str:
        return "lidar"

    def scan(self) -> LaserScan:
        self.scans += 1
        if self.error is not None:
            raise self.error
        angles = np.linspace(-math.pi, math.pi, self.BEAMS, endpoint=False)
        ranges, _ = cast_rays(self.segments, self._base.true_pose @ self.base_from_lidar, angles)
        ranges = np.where((ranges > 0.1) & (ranges < 8.0), ranges, np.inf)
        return LaserScan(ranges, -math.pi, 2 * math.pi / self.BEAMS, 0.1, 8.0, self._base.clock.now())


class ScriptedArm(Arm):
    """An arm that is where it was told last; ``blocked`` (joint: position) keeps single joints from getting there."""

    model = arm_model()

    def __init__(
        self, positions: ArrayLike, velocity: float = 2.0, name: str = "arm", acceleration: float = 100.0
    ) -> None:
        super().__init__(name)
        self.at: NDArray[np.float64] = np.array(positions, dtype=float)
        names = [f"joint_{number}" for number in range(1, len(self.at) + 1)]
        self.model = arm_model(names, lower=-3.0, upper=3.0, velocity=velocity, acceleration=acceleration, effort=50.0)
        self.motions: list[ScriptedMotion] = []
        self.sent: list[NDArray[np.float64]] = []
        self.stops = 0
        self.error: Exception | None = None
        self.time: float | None = None

    def positions(self) -> NDArray[np.float64]:
        self._check()
        return self.at.copy()

    def velocities(self) -> NDArray[np.float64]:
        return np.zeros(len(self.at))

    def efforts(self) -> NDArray[np.float64]:
        return np.zeros(len(self.at))

    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        raise NotImplementedError  # no test calls it

    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion:
        return self._begun()

    def follow(self, trajectory: JointTrajectory) -> Motion:
        return self._begun()

    def trajectory_time(self) -> float | None:
        return self.time

    def servo(self, positions: ArrayLike) -> None:
        self._check()
        self.at = np.array(positions, dtype=float)
        self.sent.append(self.at.copy())

    def stop(self) -> None:
        self.stops += 1
        if self.motions:
            self.motions[-1].abort(MotionErrorCode.STOPPED, "the arm was stopped")

    def _begun(self) -> ScriptedMotion:
        self._check()
        if self.motions:
            self.motions[-1].abort(MotionErrorCode.SUPERSEDED, "a newer command took over")
        self.motions.append(ScriptedMotion())
        return self.motions[-1]

    def _check(self) -> None:
        if self.error is not None:
            raise self.error


class ScriptedGripper(Gripper):
    """Notes what it is told, (width, force, speed); ``opening`` and ``held`` are what its encoder and motor say."""

    model = gripper_model(min_width=0.004, max_speed=0.15, max_force=70.0)

    def __init__(self) -> None:
        super().__init__("gripper")
        self.opening, self.held = 0.05, False
        self.moves: list[tuple[float, float | None, float | None]] = []
        self.motion = ScriptedMotion()
        self.error: Exception | None = None
        self.stops = 0

    def width(self) -> float:
        if self.error is not None:
            raise self.error
        return self.opening

    def state(self) -> GripperState:
        if self.error is not None:
            raise self.error
        return GripperState(False, not self.held, self.held, not self.held)

    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion:
        if self.error is not None:
            raise self.error
        self.motion.abort(MotionErrorCode.SUPERSEDED, "a newer command took over")
        self.moves.append((width, force, speed))
        self.motion = ScriptedMotion()
        return self.motion

    def stop(self) -> None:
        self.stops += 1
        self.motion.abort(MotionErrorCode.STOPPED, "the gripper was stopped")
