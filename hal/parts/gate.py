"""The gate for every joint set-point: limits position, speed, acceleration, and the motion of an arm's tool and elbow.

After each admitted set-point the joints can still brake to rest within all limits (fail-safe braking, Althoff et al.,
2019): a request beyond that is limited, and in the end the joints brake to rest.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.connection_config import SafetyConfig
from bestman_bt.robot_model.model import ArmModel, JointedModel, RobotModel

if TYPE_CHECKING:
    import pinocchio


Array = NDArray[np.float64]
SLACK = 1.001
"""Fraction of a limit up to which a set-point is admitted unchanged, to tolerate rounding."""
ROUNDING = 1e-6
BISECTIONS = 8
"""Steps of the bisection between the requested set-point and braking."""
JITTER = 2.0
"""Largest length of a cycle, in periods, for which the tool at top speed stays within its longest step."""
SPACING, MOST_SAMPLES = 0.05, 8
"""Radians between the checked positions along the braking path, and their largest number."""


class ToolLimits:
    """Positions of one arm's tool and elbow, and the tool speed, with their limits. Joint positions are (n,).

    The limits are ``workspace`` and ``tool_speed`` of ``safety``. Other joints between base and arm are assumed at
    ``home``. The elbow is the axis of the middle joint, the third of six and the fourth of seven. ``top_speed``: m/s,
    or None without a limit. Kinematics by pinocchio on the robot's URDF, loaded on first use. Thread-safe: each thread
    computes in its own memory.
    """

    def __init__(self, model: RobotModel, arm: str, safety: SafetyConfig) -> None:
        self._robot, self._arm, self.box = model, model.of(ArmModel)[arm], safety.workspace
        self.top_speed = safety.tool_speed
        self._model: pinocchio.Model | None = None
        self._of_thread = threading.local()

    @property
    def needed(self) -> bool:
        """Return whether the tool has any limit."""
        return self.box is not None or self.top_speed is not None

    def outside(self, positions: Array) -> str | None:
        """Return where the tool or the elbow would leave the workspace, as text, or None."""
        box = self.box
        if box is None:
            return None
        for what, place in zip(("tool", "elbow"), self.places(positions), strict=True):
            for axis, value, lower, upper in zip("xyz", place, box.lower, box.upper, strict=True):
                if not lower <= value <= upper:
                    room = f"its workspace is [{lower:.3f}, {upper:.3f}] m"
                    return f"the {what} would be at {axis} = {value:.3f} m, {room}"
        return None

    def outside_on_the_way(self, start: Array, end: Array) -> str | None:
        """Check the straight line in joint space like ``outside``, sampled every 0.05 rad."""
        if self.box is None:
            return None
        count = 1 + int(np.ceil(np.max(np.abs(end - start)) / SPACING))
        faults = (self.outside(start + share * (end - start)) for share in np.linspace(1.0, 0.0, count, endpoint=False))
        return next((fault for fault in faults if fault is not None), None)

    def slow_down(self, positions: Array, velocities: Array) -> float:
        """Return the speed scale in (0, 1] that keeps the tool speed of samples, (N, n) each, within its limit."""
        if self.top_speed is None:
            return 1.0
        fastest = max(self.tool_speed(q, v) for q, v in zip(positions, velocities, strict=True))
        return min(1.0, self.top_speed / max(fastest, 1e-9))

    def tool(self, positions: Array) -> Array:
        """Return the tool position in the robot's base frame, (3,) metres."""
        place: Array = self.places(positions)[0]
        return place

    def places(self, positions: Array) -> Array:
        """Return the positions of tool and elbow in the robot's base frame, (2, 3) metres."""
        import pinocchio

        model, data, q = self._at(positions)
        pinocchio.forwardKinematics(model, data, q)
        places = [data.oMi[self._last].act(self._tip), data.oMi[self._elbow].translation]
        return np.array([self._base.actInv(place) for place in places])

    def tool_speed(self, positions: Array, velocities: Array) -> float:
        """Return the tool speed relative to the base, m/s, if only this arm moves."""
        import pinocchio

        model, data, q = self._at(positions)
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self._tool, pinocchio.LOCAL_WORLD_ALIGNED)
        return float(np.linalg.norm(jacobian[:3, self._columns] @ velocities))

    def _at(self, positions: Array) -> tuple[pinocchio.Model, pinocchio.Data, Array]:
        if self._model is None:
            self._load()
        assert self._model is not None
        data = getattr(self._of_thread, "data", None)
        if data is None:
            data = self._of_thread.data = self._model.createData()
        q = self._neutral.copy()
        q[self._slots] = positions
        return self._model, data, q

    def _load(self) -> None:
        import pinocchio

        whole = pinocchio.buildModelFromXML(self._robot.urdf)
        home = pinocchio.neutral(whole)
        for name, value in self._robot.postures.get("home", {}).items():
            if whole.existJointName(name):
                home[whole.joints[whole.getJointId(name)].idx_q] = value
        names = self._arm.joint_names
        others = [number for number in range(1, whole.njoints) if whole.names[number] not in names]
        model = pinocchio.buildReducedModel(whole, others, home)
        joints = [model.joints[model.getJointId(name)] for name in names]
        self._slots = [joint.idx_q for joint in joints]
        self._columns = [joint.idx_v for joint in joints]
        self._neutral: Array = pinocchio.neutral(model)
        self._tool = model.getFrameId(self._arm.tool_frame)
        self._last, self._tip = model.frames[self._tool].parentJoint, model.frames[self._tool].placement.translation
        self._elbow = model.getJointId(names[(len(names) - 1) // 2])
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, self._neutral)
        self._base = data.oMf[model.getFrameId(self._robot.base_frame)].copy()
        self._model = model


class SetpointGate:
    """Admits set-points (n,) unchanged, or the nearest ones that satisfy all limits.

    Limits: of ``model``, and of the ``tool``, if any. During a stop, joints may brake with ``deceleration`` (n,), which
    takes at most ``stop_time`` seconds from top speed and may exceed a low acceleration limit. ``period``: period of
    the set-points, seconds. ``longest_tool_step``: metres between two tool positions.

    Speeds are means between two set-points, as a controller sees them. Joints, tool or elbow outside their limits may
    come back, but not move further out. ``position``: the last set-point. ``reason``: why it differs from the request,
    or empty.
    """

    def __init__(
        self,
        model: JointedModel,
        period: float,
        tool: ToolLimits | None = None,
        stop_time: float = 0.3,
        longest_tool_step: float = np.inf,
    ) -> None:
        self._model, self._period, self._tool, self._longest_tool_step = model, period, tool, longest_tool_step
        self._watches_tool = tool is not None and (tool.needed or np.isfinite(longest_tool_step))
        top_speed = tool.top_speed if tool is not None else None
        self._top_speed = min(np.inf if top_speed is None else top_speed, longest_tool_step / (JITTER * period))
        self.deceleration: Array = np.maximum(model.acceleration, model.velocity / stop_time)
        self._acceleration: Array = model.acceleration
        self.reason = ""
        self.start(np.zeros(len(model.joint_names)))

    def start(self, position: Array, velocity: Array | None = None) -> None:
        """Start from joints at ``position`` (n,), with ``velocity`` (n,) or at rest."""
        self.position: Array = position
        self.rate: Array = np.zeros_like(position) if velocity is None else velocity
        self._before = self._period  # seconds that the last step took
        self._places: Array | None = None

    @property
    def moving(self) -> bool:
        """Return whether the last set-point differs from the one before it."""
        return bool(np.any(self.rate != 0.0))

    def rest(self, elapsed: float) -> None:
        """Record that no set-point was sent for ``elapsed`` seconds: the joints are at rest."""
        self._before = elapsed

    def admit(
        self, wanted: Array, velocity: Array, dt: float, elapsed: float, braking: bool = False, reserve: float = 1.0
    ) -> Array:
        """Return the admitted set-point for ``wanted`` (n,), ``elapsed`` seconds after the last one; ``velocity`` (n,)
        holds there.

        ``dt``: seconds of motion that it covers, at most ``elapsed``. ``braking``: allow the deceleration of a stop.
        ``reserve``: factor on the acceleration limits.
        """
        self._acceleration = reserve * self._model.acceleration
        rate = (wanted - self.position) / dt
        self.reason = self._objection(wanted, rate, dt, self.deceleration if braking else self._acceleration)
        if self.reason:
            wanted = self._nearest(wanted, velocity, dt)
            rate = (wanted - self.position) / dt
        self.position, self.rate, self._before = wanted, rate * (dt / elapsed), elapsed
        if self._tool is not None and self._watches_tool:
            self._places = self._tool.places(wanted)
        return wanted

    def _time_to_go(self, length: float) -> float:
        """Return the seconds in which the tool moves by ``length`` while the joints brake."""
        speed = 0.0 if self._tool is None else self._tool.tool_speed(self.position, self.rate)
        braking = 2.0 * float(np.max(np.abs(self.rate) / self.deceleration))
        if speed * braking <= 0.0:
            return np.inf
        half = (braking - self._before) / 2
        root = half**2 - length * braking / speed
        return half - np.sqrt(root) if half > 0.0 and root > 0.0 else np.inf

    def _nearest(self, wanted: Array, velocity: Array, dt: float) -> Array:
        """Return the largest allowed step towards ``wanted``, between braking and the joints' limits."""
        braked, slowing = self._braked(dt), np.maximum(self.deceleration, self._acceleration)
        finite = np.all(np.isfinite([wanted, velocity]))
        asked = self._chased(wanted, velocity, dt) if finite else braked
        if not (reason := self._objection(asked, (asked - self.position) / dt, dt, slowing)):
            return asked
        self.reason, lower, upper = reason, 0.0, 1.0
        for _ in range(BISECTIONS):
            share = (lower + upper) / 2
            between = braked + share * (asked - braked)
            if self._objection(between, (between - self.position) / dt, dt, slowing):
                upper = share
            else:
                lower = share
        if lower == 0.0 and np.isfinite(self._longest_tool_step):  # a late cycle at a high speed: the set-point waits
            return self._braked(min(dt, self._time_to_go(0.95 * self._longest_tool_step)))
        nearest: Array = braked + lower * (asked - braked)
        return nearest

    def _chased(self, wanted: Array, velocity: Array, dt: float) -> Array:
        """Return the step towards a set-point that moves at ``velocity``, so that it is reached without overshoot.

        It may brake as hard as the joints themselves can. So no joint is faster than allows it to come to rest where
        the set-point would.
        """
        limits, acceleration, time = self._model, self._acceleration, (self._before + dt) / 2
        step = acceleration * dt
        error = wanted - velocity * dt - self.position
        to_rest = error + velocity * (np.abs(velocity) / (2.0 * acceleration) + dt / 2)
        stopping = np.sign(to_rest) * step * (np.sqrt(0.25 + 2.0 * np.abs(to_rest) / (step * dt)) - 0.5)
        rate = velocity + np.clip(stopping - velocity, -np.abs(error) / dt, np.abs(error) / dt)
        change = acceleration * time
        rate = np.clip(np.clip(rate, -limits.velocity, limits.velocity), self.rate - change, self.rate + change)
        chased: Array = self.position + rate * dt
        return chased

    def _braked(self, dt: float) -> Array:
        """Return the next set-point on the way to rest; a joint that moves too fast for it stops at its limit.

        A joint beyond its limit only by rounding keeps its deceleration.
        """
        middle, limits = self._before / 2, self._model
        times = self._braking_times(self.position, self.rate, middle)
        way = _way(middle + dt, times) - _way(middle, times)
        braked: Array = self.position + self.rate * way
        lower, upper = np.minimum(limits.lower, self.position), np.maximum(limits.upper, self.position)
        inside = np.clip(braked, lower, upper)
        return np.where(np.abs(braked - inside) > ROUNDING, inside, braked)

    def _braking_times(self, position: Array, rate: Array, middle: float) -> Array:
        """Return the seconds (n,) from full speed to rest: all joints together, or sooner where one has less room.

        ``rate``: mean speeds ``middle`` seconds ago.
        """
        fastest = np.abs(rate) / self.deceleration
        room = np.where(rate > 0.0, self._model.upper - position, position - self._model.lower)
        length = middle + np.maximum(room, 0.0) / np.maximum(np.abs(rate), 1e-12)
        times: Array = np.maximum(fastest, np.minimum(np.max(fastest), length + np.sqrt(length**2 - middle**2)))
        return times

    def _objection(self, wanted: Array, rate: Array, dt: float, acceleration: Array) -> str:
        """Return which limit a set-point, or the braking after it, would violate; empty: none."""
        limits, names = self._model, self._model.joint_names
        if not np.all(np.isfinite(wanted)):
            return "a set-point is not finite"
        speed = np.abs(rate)
        if np.any(fast := speed > limits.velocity * SLACK + ROUNDING):
            return f"{names[int(np.argmax(fast))]} would be faster than its limit"
        allowed = np.where(speed < np.abs(self.rate), acceleration, self._acceleration) * (self._before + dt) / 2
        if np.any(sudden := np.abs(rate - self.rate) > allowed * SLACK + ROUNDING):
            return f"{names[int(np.argmax(sudden))]} would accelerate more than its limit"
        fastest = speed / self.deceleration
        end = wanted + rate * (_way(np.inf, fastest) - _way(dt / 2, fastest))
        lower = np.minimum(limits.lower - ROUNDING, self.position)  # which creeps no farther out by rounding
        upper = np.maximum(limits.upper + ROUNDING, self.position)
        beyond = (np.minimum(wanted, end) < lower) | (np.maximum(wanted, end) > upper)
        if np.any(beyond):
            return f"{names[int(np.argmax(beyond))]} would leave its range"
        return self._objection_of_tool(wanted, rate, dt) if self._watches_tool else ""

    def _objection_of_tool(self, wanted: Array, rate: Array, dt: float) -> str:
        tool = self._tool
        assert tool is not None
        if self._places is None:
            self._places = tool.places(self.position)
        here, there = self._places, tool.places(wanted)
        step, speed = float(np.linalg.norm(there[0] - here[0])), self._top_speed
        if step > self._longest_tool_step:
            return f"the tool would step by {1e3 * step:.1f} mm, its limit is {1e3 * self._longest_tool_step:.0f} mm"
        if step > speed * dt * SLACK:
            return "the tool would be faster than its limit"
        if _leaves(tool, there, here):
            return tool.outside(wanted) or "the tool would leave its workspace"
        middle = dt / 2
        times = self._braking_times(wanted, rate, middle)
        ways = _way(np.inf, times) - _way(middle, times)
        count = min(MOST_SAMPLES, 1 + int(np.max(np.abs(rate * ways)) / SPACING))
        last = float(np.max(times))
        for share in np.linspace(0.0, 1.0, count + 1)[1:] if last > middle else ():
            time = middle + (last - middle) * share**2  # closer together where the joints are still fast
            place = wanted + rate * (_way(time, times) - _way(middle, times))
            left = rate * np.maximum(0.0, 1.0 - time / np.maximum(times, 1e-12))
            if np.isfinite(speed) and tool.tool_speed(place, left) > speed * SLACK:
                return "the tool would be faster than its limit"
            if tool.box is not None and _leaves(tool, tool.places(place), here):
                return tool.outside(place) or "the tool would leave its workspace"
        return ""


def _way(time: float, braking: Array) -> Array:
    """Return the seconds of full speed that a joint moves within ``time`` after it has begun to brake to rest in
    ``braking``.
    """
    passed = np.minimum(time, braking)
    way: Array = passed - passed**2 / (2.0 * np.maximum(braking, 1e-12))
    return way


def _leaves(tool: ToolLimits, there: Array, here: Array) -> bool:
    """Return whether a place, (2, 3), is outside the box, and farther than ``here``."""
    if tool.box is None:
        return False
    lower = np.minimum(np.array(tool.box.lower) - ROUNDING, here)
    upper = np.maximum(np.array(tool.box.upper) + ROUNDING, here)
    return bool(np.any((there < lower) | (there > upper)))
