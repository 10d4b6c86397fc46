"""How often a child is ticked, by how the base moves: SpeedController, DistanceController, PathLongerOnApproach."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from py_trees.ports import PortInformation

from behaviours.nav2.goals import WATCHED
from behaviours.nav2.ports import FRAMES, are_literals
from behaviours.skill import OnRobot
from bestman_bt.engine import IDLE, RUNNING, SKIPPED, SUCCESS, BoundedPort, Decorator
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.messages.bounds import NonNegative, Positive


class SpeedController(OnRobot, Decorator):
    """Tick the child the more often the faster the base is; at once where it starts, and where the goal changes.

    Between ``min_speed`` and ``max_speed`` the rate goes from ``min_rate`` to ``max_rate``. RUNNING in between.
    """

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {
        **WATCHED,
        "min_rate": BoundedPort(Positive, required=False, default_value=0.1, description="hertz, above 0"),
        "max_rate": BoundedPort(Positive, required=False, default_value=1.0, description="hertz"),
        "min_speed": BoundedPort(NonNegative, required=False, default_value=0.0, description="m/s"),
        "max_speed": BoundedPort(Positive, required=False, default_value=0.5, description="m/s"),
    }

    def on_load(self) -> None:
        """Begin with no time running; judge the limits where all are literals."""
        self._since, self._period, self._due = 0.0, 0.0, True
        self._goals: tuple[Any, Any] = (None, None)
        if are_literals(self, "min_rate", "max_rate", "min_speed", "max_speed"):
            self._limits()

    def on_tick(self) -> int:
        """Tick the child if it runs or is due."""
        now, goals = self.clock.now(), (self.get_input("goal"), self.get_input("goals"))
        if self._s <= IDLE or goals != self._goals:
            self._goals, self._since, self._due = goals, now, True
            self._period = 1.0 / self.get_input("max_rate")
        self.set_state(RUNNING)
        over = now - self._since >= self._period
        if not (self._due or over or self.child._s == RUNNING):
            return RUNNING
        self._due = False
        if over:
            self._since, self._period = now, 1.0 / self._rate()
        return self.child.execute_tick()

    def _rate(self) -> float:
        """Hertz at which the base's speed asks for the child."""
        low, high, slow, fast = self._limits()
        velocity = self.skills.base.velocity()
        share = (math.hypot(velocity.vx, velocity.vy) - slow) / (fast - slow)
        return float(low + min(max(share, 0.0), 1.0) * (high - low))

    def _limits(self) -> tuple[float, float, float, float]:
        low, high = self.get_input("min_rate"), self.get_input("max_rate")
        slow, fast = self.get_input("min_speed"), self.get_input("max_speed")
        if low > high:
            raise self.error(f"min_rate is {low} Hz and max_rate {high} Hz, but the minimum is not above the maximum")
        if slow >= fast:
            raise self.error(f"min_speed is {slow} m/s and max_speed {fast} m/s, but the minimum is below the maximum")
        return low, high, slow, fast


class DistanceController(OnRobot, Decorator):
    """Tick the child where it starts, and whenever the base has come ``distance`` metres farther; RUNNING between."""

    INPUT_PORTS: ClassVar = {
        **FRAMES,
        "distance": BoundedPort(Positive, required=False, default_value=1.0, description="metres, as the crow flies"),
    }

    def on_load(self) -> None:
        """Begin nowhere."""
        self._from, self._due = Pose2D(), True

    def on_tick(self) -> int:
        """Tick the child if it runs or is due."""
        pose = self.skills.world.base.pose
        if self._s <= IDLE:
            self._from, self._due = pose, True
        self.set_state(RUNNING)
        travelled = pose.distance_to(self._from)
        if not (self._due or travelled >= self.get_input("distance") or self.child._s == RUNNING):
            return RUNNING
        self._due = False
        status = self.child.execute_tick()
        if status == SUCCESS:
            self._from = pose
        return status


class PathLongerOnApproach(Decorator):
    """Tick the child where a new path close to the goal is much longer than the one before it; else SUCCESS.

    That is what a blocked approach looks like: waiting may be better than going all the way round.
    """

    INPUT_PORTS: ClassVar = {
        "path": PortInformation(Path2D, required=False, description="the path that is planned again and again"),
        "prox_len": BoundedPort(Positive, required=False, default_value=3.0, description="metres that count as close"),
        "length_factor": BoundedPort(Positive, required=False, default_value=2.0, description="that counts as longer"),
    }

    def on_load(self) -> None:
        """Begin with no path."""
        self._before: Path2D | None = None

    def halt(self) -> None:
        """Forget the path."""
        self._before = None
        super().halt()

    def on_tick(self) -> int:
        """Compare the path with the one before."""
        path: Path2D | None = self.get_input("path")
        if self.child._s != RUNNING and not self._is_longer(path):
            self._before = path
            return SUCCESS
        self.set_state(RUNNING)
        status = self.child.execute_tick()
        if status not in (RUNNING, SKIPPED):
            self._before = path
        return status

    def _is_longer(self, path: Path2D | None) -> bool:
        """Whether ``path`` leads to the same goal as the one before, and that one was short and this one is not."""
        before = self._before
        if path is None or before is None or path is before or path.goal != before.goal:
            return False
        short = before.length < self.get_input("prox_len")
        return bool(short and path.length > self.get_input("length_factor") * before.length)
