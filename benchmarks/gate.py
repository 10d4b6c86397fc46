"""Hostile commands through the gate of set-points and each vendor's channel, on a virtual clock.

Usage: ``python benchmarks/gate.py --trials 2000 --seed 0 --json``. A trial is one arm with limits of its own, and a
dozen commands one upon another: motions, trajectories that no planner would make, streams, velocities, stops, faults,
joints that are held up, late cycles. What the wire took is measured: no set-point may break a limit by more than 1 %.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bestman_bt.evaluation.versions import versions
from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.connection_config import SafetyConfig, WorkspaceConfig
from bestman_bt.robot_model.hardware_config import with_hardware
from bestman_bt.robot_model.model import ArmModel, JointedModel, JointGroupModel, RobotModel
from hal.api import CommandRefusedError, Failure, MotionErrorCode
from hal.parts.channels import JointReading
from hal.parts.gate import ToolLimits
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup
from hal.rosbridge.connection import RosJoints
from hal.rosbridge.options import RosbridgeOptions
from hal.ur.connection import URJoints
from hal.ur.sdk_process import Report
from hal.xarm.connection import LONGEST_STEP, XArmJoints

Array = NDArray[np.float64]
FOLDER = Path(__file__).parents[1] / "tests" / "hal"
ROBOTS: dict[str, str | Path] = {
    "ur": FOLDER / "ur" / "ur5e_on_a_base.yaml",
    "xarm": FOLDER / "xarm" / "xarm6_on_a_base.yaml",
    "rosbridge": "diff_panda",
}
RATES = {"ur": 500.0, "xarm": 200.0, "rosbridge": 50.0}
TOLERANCE = 1.01
STOP_TIME = 0.3
WAITING_STEP = 0.92
"""Share of the tool's longest step from which late cycles are exempt from the acceleration.

Where no set-point keeps both limits, the tool's step counts: the joints wait, so that it is 0.95 of the longest by the
Jacobian. By the kinematics it was 0.926 to 0.969 in 358 such cycles of joints at high speeds in random directions; any
late cycle with a shorter step keeps the acceleration.
"""
LATEST = 3
"""Periods that a cycle may be late by: what is later is a pause of the set-points, and no speed can be told of it."""


class Wire:
    """Stands for a vendor's wire: keeps what it is sent; the joints are there, plus what holds them ``off``."""

    def __init__(self, positions: Array) -> None:
        self.at, self.off = positions, np.zeros_like(positions)
        self.took = False

    def take(self, positions: list[float]) -> int:
        self.at, self.took = np.array(positions), True
        return 0

    def reading(self) -> JointReading:
        rest = np.zeros_like(self.at)
        return JointReading(self.at + self.off, rest, rest)


class URWire(Wire):
    """As ``URLink``."""

    age = 0.0

    def send(self, positions: list[float]) -> None:
        self.take(positions)

    @property
    def report(self) -> Report:
        place, zeros = (self.at + self.off).tolist(), [0.0] * 6
        return Report(0.0, 0.0, place, zeros, zeros, zeros, zeros, 0, 0, 7, 1, 2, False, False)


class XArmSdk(Wire):
    """As ``XArmWire`` and the SDK's object behind it."""

    def ask(self, question: Callable[[Any], tuple[int, Any]]) -> Any:
        return question(self)[1]

    def send(self, what: str, command: Callable[[Any], int]) -> None:
        command(self)

    def get_joint_states(self, is_radian: bool, num: int) -> tuple[int, Any]:
        reading = self.reading()
        return 0, [reading.positions, reading.velocities, reading.efforts]

    def set_servo_angle_j(self, positions: list[float], is_radian: bool) -> int:
        return self.take(positions)


class RosWire(Wire):
    """As ``RosLink`` and the stream of joint states."""

    age = 0.0

    def publish(self, topic: str, message: Any) -> None:
        self.take(message["points"][-1]["positions"])

    def latest(self) -> JointReading:
        return self.reading()


@dataclass
class Record:
    """``places``, (N, n), at ``times``, (N,), from one start of the set-points to the next."""

    times: list[float] = field(default_factory=list)
    places: list[Array] = field(default_factory=list)


@cache
def robot(vendor: str) -> RobotModel:
    """The vendor's robot without limits of its own."""
    return load_robot_model(ROBOTS[vendor])


class Trial:
    """One vendor's joints, driven by ``rng``."""

    def __init__(self, vendor: str, rng: np.random.Generator) -> None:
        self._rng, self._vendor, self.refused, self.accepted = rng, vendor, 0, 0
        whole, self._period = robot(vendor), 1.0 / RATES[vendor]
        kind = JointGroupModel if vendor == "rosbridge" else ArmModel
        name = next(iter(whole.of(kind)))
        home = whole.posture("home", whole.of(ArmModel)[name].joint_names) if kind is ArmModel else np.zeros(2)
        self._safety = self._draw_safety(whole, name, home) if kind is ArmModel else SafetyConfig()
        self._model = with_hardware(whole, {}, self._safety)
        self.joints: JointedModel = self._model.of(kind)[name]
        self._tool = ToolLimits(self._model, name, self._safety) if kind is ArmModel else None
        self._start = np.clip(home, self.joints.lower, self.joints.upper)
        self._group = self._make(name)
        self._now = 0.0
        self.records: list[Record] = []

    def _draw_safety(self, whole: RobotModel, name: str, home: Array) -> SafetyConfig:
        rng, box = self._rng, None
        if rng.random() < 0.6:
            places = ToolLimits(whole, name, SafetyConfig()).places(home)
            lower = places.min(axis=0) - rng.uniform(0.02, 0.4, 3)
            upper = places.max(axis=0) + rng.uniform(0.02, 0.4, 3)
            box = WorkspaceConfig(tuple(lower), tuple(upper))
        speed = float(rng.uniform(0.05, 1.0)) if rng.random() < 0.6 else None
        return SafetyConfig(joint_speed=float(rng.choice([0.1, 0.5, 1.0])), tool_speed=speed, workspace=box)

    def _make(self, name: str) -> StreamedJointGroup:
        latch, wire = StopLatch(), {"ur": URWire, "xarm": XArmSdk, "rosbridge": RosWire}[self._vendor](self._start)
        self._wire: Wire = wire
        group: StreamedJointGroup
        if self._vendor == "rosbridge":
            names, options = self.joints.joint_names, RosbridgeOptions()
            channel: Any = RosJoints(cast(Any, wire), "/head", names, options, cast(Any, wire))
            return StreamedJointGroup(name, self.joints, channel, latch, self._period)
        arm = cast(ArmModel, self.joints)
        assert self._tool is not None
        link = cast(Any, wire)
        channel = URJoints(link, 1.0) if self._vendor == "ur" else XArmJoints(link, len(self._start))
        group = StreamedArm(name, arm, channel, latch, self._period, self._tool)
        self._channel = channel
        return group

    def run(self, commands: int) -> None:
        """``commands`` of them, each some time after the one before."""
        self._attach()
        acts = [self._move, self._set, self._drive, self._brake, self._fail, self._hold_up]
        if isinstance(self._group, StreamedArm):
            acts += 2 * [self._follow, self._stream]
        for _ in range(commands):
            act = acts[self._rng.integers(len(acts))]
            try:
                act()
                self.accepted += 1
            except CommandRefusedError:
                self.refused += 1
            self._pass(float(self._rng.choice([0.02, 0.1, 0.3, 0.8])))
        self._group.stop()
        self._pass(0.5)

    def _attach(self) -> None:
        self._refresh()
        self._group.attach()
        self.records.append(Record([self._now], [self._wire.at]))

    def _refresh(self) -> None:
        if self._vendor == "xarm":
            self._channel.refresh()

    def _pass(self, seconds: float) -> None:
        jitter, end = float(self._rng.choice([0.0, 0.0, 0.2])), self._now + seconds
        while self._now < end:
            elapsed = self._period * (1.0 + jitter * self._rng.uniform(-1.0, 1.0))
            if jitter and self._rng.random() < 0.02:
                elapsed = self._period * self._rng.uniform(1.0, LATEST)
            self._now += elapsed
            self._refresh()
            self._group.cycle(elapsed)
            self.records[-1].times.append(self._now)
            self.records[-1].places.append(self._wire.at)

    def _target(self) -> Array:
        reach = float(self._rng.choice([0.02, 0.2, 1.0, 4.0]))
        target = self._wire.at + self._rng.uniform(-reach, reach, len(self._start))
        clipped: Array = np.clip(target, self.joints.lower, self.joints.upper)
        return clipped

    def _move(self) -> None:
        self._group.move_to(self._target(), float(self._rng.choice([0.05, 0.5, 1.0])))

    def _set(self) -> None:
        self._group.command(positions=self._target())

    def _drive(self) -> None:
        share = self._rng.uniform(-1.0, 1.0, len(self._start)) * self._rng.choice([0.1, 1.0])
        for _ in range(self._rng.integers(1, 6)):
            self._group.command(velocities=share * self.joints.velocity)
            self._pass(0.2)

    def _brake(self) -> None:
        (self._group.stop if self._rng.random() < 0.5 else self._group.brake)()

    def _fail(self) -> None:
        code = self._rng.choice([MotionErrorCode.TIMEOUT, MotionErrorCode.FAULT])
        self._group.fail(Failure(code, "something is wrong"))

    def _hold_up(self) -> None:
        """Something holds the joints where they are."""
        place = self._wire.at + self._wire.off
        for _ in range(self._rng.integers(1, 60)):
            self._wire.off = place - self._wire.at
            self._pass(self._period)
        self._wire.off = np.zeros_like(place)

    def _follow(self) -> None:
        rng, arm = self._rng, cast(StreamedArm, self._group)
        count = int(rng.integers(2, 7))
        size = float(rng.choice([0.05, 0.5, 1.5]))
        positions = np.vstack([self._wire.at, self._wire.at + rng.uniform(-size, size, (count - 1, len(self._start)))])
        positions[0] += rng.uniform(-0.04, 0.04, len(self._start)) * rng.integers(2)
        least = np.max(np.abs(np.diff(positions, axis=0)) / self.joints.velocity, axis=1)
        times = np.concatenate([[0.0], np.cumsum(least * rng.uniform(1.0, 3.0, count - 1) + 1e-3)])
        speeds = rng.uniform(-1.0, 1.0, positions.shape) * self.joints.velocity * rng.choice([0.0, 0.3, 1.0])
        speeds[-1] = 0.0
        arm.follow(JointTrajectory(arm.joint_names, times, positions, speeds))

    def _stream(self) -> None:
        arm, between = cast(StreamedArm, self._group), float(self._rng.choice([self._period, 0.01, 0.05, 0.12]))
        step = self._rng.uniform(-1.0, 1.0, len(self._start)) * self.joints.velocity * between
        step = step * self._rng.choice([0.1, 0.9])
        target = self._wire.at
        for _ in range(min(40, int(0.6 / between))):
            target = np.clip(target + step, self.joints.lower, self.joints.upper)
            if self._rng.random() < 0.05:
                step = -step
            arm.servo(target)
            self._pass(between)

    def worst(self) -> dict[str, float]:
        """The largest share of each limit that a set-point has come to."""
        worst: dict[str, float] = {}
        for record in self.records:
            for limit, share in self._measured(np.array(record.times), np.array(record.places)).items():
                worst[limit] = max(worst.get(limit, 0.0), share)
        return worst

    def _measured(self, times: Array, places: Array) -> dict[str, float]:
        joints, dt = self.joints, np.diff(times)[:, None]
        rates = np.vstack([np.zeros(places.shape[1]), np.diff(places, axis=0) / dt])
        dt = np.vstack([[self._period], dt])
        changes = np.abs(np.diff(rates, axis=0)) / ((dt[:-1] + dt[1:]) / 2)
        slower = np.abs(rates[1:]) < np.abs(rates[:-1])
        allowed = np.where(slower, np.maximum(joints.acceleration, joints.velocity / STOP_TIME), joints.acceleration)
        middle, half = (joints.lower + joints.upper) / 2, (joints.upper - joints.lower) / 2
        shares = changes / allowed
        where = np.zeros((0, 2, 3))
        if self._tool is not None and (self._tool.needed or self._vendor == "xarm"):
            where = np.array([self._tool.places(place) for place in places])
        steps = np.linalg.norm(np.diff(where[:, 0], axis=0), axis=1)
        if self._vendor == "xarm":
            shares = shares[(steps < WAITING_STEP * LONGEST_STEP) | (dt[1:, 0] < 1.2 * self._period)]
        found = {
            "position": float(np.max(np.abs(places - middle) / half)),
            "speed": float(np.max(np.abs(rates) / joints.velocity)),
            "acceleration": float(np.max(shares, initial=0.0)),
        }
        if self._vendor == "xarm" and len(steps):
            found["tool step"] = float(np.max(steps)) / LONGEST_STEP
        if self._safety.tool_speed is not None and len(steps):
            found["tool speed"] = float(np.max(steps / dt[1:, 0])) / self._safety.tool_speed
        if (box := self._safety.workspace) is not None:
            lower, upper = np.array(box.lower), np.array(box.upper)
            found["box"] = float(np.max(np.abs(where - (lower + upper) / 2) / ((upper - lower) / 2)))
        return found


def faults(vendor: str, seed: int, commands: int = 12) -> tuple[list[str], Trial]:
    """What a trial has broken, in words, and the trial."""
    trial = Trial(vendor, np.random.default_rng([seed, list(ROBOTS).index(vendor)]))
    trial.run(commands)
    broken = [f"{limit}: {share:.3f}" for limit, share in trial.worst().items() if share > TOLERANCE]
    return [f"{vendor}, seed {seed}: {fault} of its limit" for fault in broken], trial


def main() -> int:
    """Run the trials; 1 where a limit was broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2000, help="of each vendor")
    parser.add_argument("--seed", type=int, default=0, help="of the first trial")
    parser.add_argument("--vendors", nargs="*", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    asked = parser.parse_args()
    broken: list[str] = []
    report: dict[str, Any] = {"trials": asked.trials, "versions": versions()}
    for vendor in asked.vendors:
        counts: Counter[str] = Counter()
        worst: dict[str, float] = {}
        for seed in range(asked.seed, asked.seed + asked.trials):
            found, trial = faults(vendor, seed)
            broken += found
            counts.update(
                accepted=trial.accepted,
                refused=trial.refused,
                set_points=sum(len(record.times) for record in trial.records),
            )
            for limit, share in trial.worst().items():
                worst[limit] = max(worst.get(limit, 0.0), share)
        report[vendor] = {**counts, "worst": {limit: round(share, 4) for limit, share in worst.items()}}
    report["broken"] = broken
    print(json.dumps(report, indent=2) if asked.json else "\n".join(f"{key}: {value}" for key, value in report.items()))
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main())
