"""What becomes of the robot when ``bestman-bt run`` is killed, or stopped from another terminal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from benchmarks.fault_trials.left_behind import LeftBehind
from benchmarks.fault_trials.trial import GRACE, UR, XARM
from benchmarks.fault_trials.truth import moves, rests_at
from bestman_bt.messages import Pose, Pose2D, wrap_angle
from bestman_bt.runtime.resolved_config import ResolvedConfig
from hal.api import MobileBase
from hal.hardware.isolated_robot import IsolatedRobot
from hal.twins.process import TwinProcess

COMMAND = [sys.executable, "-m", "bestman_bt.cli.main"]
START_TIME, REST_TIME, END_TIME = 120.0, 5.0, 15.0
CANCELLED = 130
TO_AND_FRO = """<root BTCPP_format="4"><BehaviorTree ID="ToAndFro"><Repeat num_cycles="50"><Sequence>
  <MoveArm posture="home"/><MoveArm posture="carry"/>
</Sequence></Repeat></BehaviorTree></root>"""
ROUND = """<root BTCPP_format="4"><BehaviorTree ID="Round"><Repeat num_cycles="50"><Sequence>
  <NavigateTo goal="{x};{y};{there}"/><NavigateTo goal="{x};{y};{back}"/>
</Sequence></Repeat></BehaviorTree></root>"""


class End(StrEnum):
    """What happens to the client."""

    KILLED = "killed"  # the process that plans, with signal 9
    ALL_KILLED = "all killed"  # and those that hold its connections
    STOPPED = "stopped"  # bestman-bt stop


@dataclass(frozen=True)
class ClientTrial:
    """``base``: the base turns, else the arm swings. ``allowed``: seconds until it rests."""

    name: str
    robot: str
    end: End
    allowed: float
    base: bool = False

    @property
    def exit_code(self) -> int:
        """Of the client."""
        return CANCELLED if self.end is End.STOPPED else -signal.SIGKILL


@dataclass(frozen=True)
class ClientReport:
    """``rest``: seconds from the signal, or from when ``bestman-bt stop`` had returned. ``code``: the client's exit."""

    rest: float
    code: int
    words: str
    orphans: tuple[str, ...]


WATCHDOG, BRAKING, TURN_BRAKING = 0.3, 0.3, 0.6
CLIENT_TRIALS = tuple(
    ClientTrial(f"client/{robot} {'base' if base else 'arm'} {end}", robot, end, allowed, base)
    for robot, base in ((XARM, False), (XARM, True), (UR, False))
    for end, allowed in (
        (End.KILLED, WATCHDOG + (TURN_BRAKING if base else BRAKING)),
        (End.ALL_KILLED, WATCHDOG + (TURN_BRAKING if base else BRAKING)),
        (End.STOPPED, TURN_BRAKING if base else BRAKING),
    )
)


def run_client_trial(trial: ClientTrial, twin: TwinProcess, setup: ResolvedConfig) -> ClientReport:
    """``setup``: of the twin's robot. The base faces where it did at first afterwards, as sessions believe it does."""
    report = _end(trial, twin, setup)
    if trial.base:
        _turn_back(twin, setup)
    return report


def _end(trial: ClientTrial, twin: TwinProcess, setup: ResolvedConfig) -> ClientReport:
    left = LeftBehind()
    with tempfile.TemporaryDirectory() as folder:
        tree, output = Path(folder) / "tree.xml", Path(folder) / "output"
        tree.write_text(_round(setup.world.robot_start) if trial.base else TO_AND_FRO)
        command = [*COMMAND, "run", str(tree), "--task", setup.config.name, "--robot", trial.robot]
        command += ["--driver", "hardware", "--seed", str(setup.config.seed), "--runs", folder]
        command += [word for key, value in twin.settings.items() for word in ("--set", f"robot.{key}={value}")]
        with (
            output.open("w") as stream,
            subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT, start_new_session=True) as client,
        ):
            if not moves(twin, START_TIME):
                os.killpg(client.pid, signal.SIGKILL)
                return ClientReport(float("inf"), client.wait(), output.read_text(), ())
            left.note()
            ended = time.monotonic()
            if trial.end is End.STOPPED:
                subprocess.run([*COMMAND, "stop"], check=True, stdout=subprocess.DEVNULL)
                ended = time.monotonic()
            elif trial.end is End.KILLED:
                client.send_signal(signal.SIGKILL)
            else:
                os.killpg(client.pid, signal.SIGKILL)
            rest = rests_at(twin, REST_TIME) - ended
            code = client.wait(END_TIME)
        return ClientReport(rest, code, output.read_text()[-300:], tuple(left.after(GRACE)))


def _turn_back(twin: TwinProcess, setup: ResolvedConfig) -> None:
    told = twin.judge("base_pose")
    heading = Pose(np.array(told["position"]), np.array(told["quaternion"])).to_pose2d().theta
    with IsolatedRobot(setup.robot_model) as robot:
        motion = robot.part("base", MobileBase).rotate(wrap_angle(setup.world.robot_start.theta - heading))
        while not motion.done:
            robot.clock.sleep(0.05)
        if motion.failure is not None:
            raise RuntimeError(f"the base does not turn back: {motion.failure.text}")


def _round(start: Pose2D) -> str:
    """The tree that turns to and fro."""
    return ROUND.format(x=start.x, y=start.y, there=start.theta + 2.0, back=start.theta)
