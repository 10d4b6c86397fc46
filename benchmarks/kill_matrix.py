"""What is left of a motion when a process of a hardware run is killed or stopped, over the vendors' twins.

At random moments of a swing of the arm, the planner's process, the robot process and (UR) the SDK's process get signal
9 or SIGSTOP. Measured by the twin's clock: how long the arm still moves; whether it moves later without a new command,
also after SIGCONT; and whether the robot can be commanded again.

    python -m benchmarks.kill_matrix --trials 30 --json kill_matrix.json
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from bestman_bt.bringup.killed_processes import python_children
from hal.twins.process import TwinProcess

ROBOTS = {
    "xarm": Path("tests/hal/xarm/xarm6_on_a_base.yaml"),
    "ur": Path("tests/hal/ur/ur5e_on_a_base.yaml"),
}
PROCESSES = {"xarm": ("planner", "robot"), "ur": ("planner", "robot", "sdk")}
SIGNALS = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}
STILL = 0.02
"""rad/s below which a joint counts as at rest."""
WATCHED = 1.2
"""Seconds of the twin's clock for which the arm is watched after the signal; then again after SIGCONT, for a third."""
REST_LIMIT = 0.5
PATIENCE = 90.0
PLANNER = """
import json, sys, time
from bestman_bt.errors import RobotError
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm, MotionStatus
from hal.hardware.isolated_robot import IsolatedRobot

def tell(word, **more):
    print(json.dumps({"word": word, **more}), flush=True)

with IsolatedRobot(load_robot_model(sys.argv[1], json.loads(sys.argv[2]))) as robot:
    arm = robot.part("arm", Arm)
    middle = robot.model.posture("home", arm.joint_names)
    side = 0.4
    while True:
        motion = arm.move_to(middle + [side, 0, 0, 0, 0, 0], 0.2)
        tell("moves")
        while not motion.done:
            robot.clock.sleep(0.02)
        side = -side
        if motion.status is MotionStatus.SUCCEEDED:
            continue
        robot.stop()
        tell("stopped", why=str(motion.failure), stopped=robot.stopped)
        if not sys.stdin.readline():
            break
        deadline = time.monotonic() + 30.0
        while robot.stopped:
            try:
                robot.clear_stop()
            except RobotError as error:
                if time.monotonic() > deadline:
                    tell("lost", why=str(error))
                    sys.exit(1)
                time.sleep(0.5)
"""


@dataclass(frozen=True)
class Trial:
    """``rest``: seconds of the twin's clock until the arm stood. ``again``: seconds until it moved by a new command."""

    rest: float
    moved_later: bool
    again: float | None
    why: str

    @property
    def passed(self) -> bool:
        """Whether everything was as it must be."""
        return self.rest <= REST_LIMIT and not self.moved_later and self.again is not None


class Planner:
    """The program that commands the arm, in a process of its own."""

    def __init__(self, robot_file: Path, settings: Mapping[str, object]) -> None:
        command = [sys.executable, "-c", PLANNER, str(robot_file), json.dumps(dict(settings))]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def hear(self, word: str) -> dict[str, object]:
        """Wait for what it tells; RuntimeError where it tells that it is lost, or ends."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            told: dict[str, object] = json.loads(line)
            if told["word"] == word:
                return told
            if told["word"] == "lost":
                raise RuntimeError(str(told["why"]))
        raise RuntimeError("the planner has ended")

    def go_on(self) -> None:
        """Let it clear the stop and command the arm anew."""
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def pid_of(self, name: str) -> int:
        """Of the planner's, the robot or the SDK's process."""
        pid = self.process.pid
        for _ in range(("planner", "robot", "sdk").index(name)):
            (pid,) = python_children(pid)
        return pid

    def close(self) -> None:
        """End it, and the processes below it."""
        self.process.kill()
        self.process.communicate()


class Watch:
    """The arm as its twin knows it."""

    def __init__(self, twin: TwinProcess) -> None:
        self._twin = twin

    def now(self) -> float:
        """Seconds of the twin's clock."""
        return float(self._twin.judge("time")["time"])

    def speed(self) -> float:
        """Of the fastest joint, rad/s."""
        return max(map(abs, self._twin.judge("joints", "arm")["velocities"]))

    def last_moved(self, since: float, until: float) -> float:
        """How many seconds after ``since`` a joint still moved, looked at until ``until`` seconds after it."""
        last = 0.0
        while (passed := self.now() - since) < until:
            if self.speed() > STILL:
                last = passed
            time.sleep(0.005)
        return last


def trial(planner: Planner, watch: Watch, process: str, kind: str, moment: float) -> tuple[Trial, bool]:
    """One of them, ``moment`` seconds after the arm has set out; and whether the planner still lives."""
    planner.hear("moves")
    deadline = time.monotonic() + PATIENCE
    while watch.speed() < 2 * STILL and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(moment)
    pid = planner.pid_of(process)
    since = watch.now()
    os.kill(pid, SIGNALS[kind])
    rest = watch.last_moved(since, WATCHED)
    lives = (process, kind) != ("planner", "kill")
    if kind == "stop":
        with suppress(ProcessLookupError):  # it was killed because it hung
            os.kill(pid, signal.SIGCONT)
    moved_later = watch.last_moved(watch.now(), WATCHED / 3) > 0.0
    if not lives:
        return Trial(rest, moved_later, None, ""), False
    why = str(planner.hear("stopped")["why"])
    begun = time.monotonic()
    planner.go_on()
    try:
        planner.hear("moves")
    except RuntimeError as error:
        return Trial(rest, moved_later, None, f"{why}; {error}"), False
    return Trial(rest, moved_later, time.monotonic() - begun, why), True


@contextmanager
def planners(robot_file: Path, settings: Mapping[str, object]) -> Iterator[list[Planner]]:
    """The one that runs, in a list of one."""
    running = [Planner(robot_file, settings)]
    try:
        yield running
    finally:
        running[0].close()


def trials(
    twin: TwinProcess, robot_file: Path, cases: list[tuple[str, str]], seed: int, settings: Mapping[str, object]
) -> list[tuple[str, str, Trial]]:
    """One trial for each of ``cases``, (process, signal), over a twin that runs."""
    watch, rng, done = Watch(twin), random.Random(seed), []
    with planners(robot_file, settings) as running:
        for process, kind in cases:
            result, lives = trial(running[0], watch, process, kind, rng.uniform(0.0, 1.2))
            if not lives:
                running[0].close()
                begun = time.monotonic()
                running[0] = Planner(robot_file, settings)
                try:
                    running[0].hear("moves")
                    result = Trial(result.rest, result.moved_later, time.monotonic() - begun, result.why)
                except RuntimeError as error:
                    result = Trial(result.rest, result.moved_later, None, str(error))
                    running[0].close()
                    running[0] = Planner(robot_file, settings)
            done.append((process, kind, result))
            print(f"{process} {kind}: {result}", file=sys.stderr, flush=True)
    return done


def summary(results: list[Trial]) -> dict[str, object]:
    """Of one cell of the matrix."""
    rests = [result.rest for result in results]
    again = [result.again for result in results if result.again is not None]
    return {
        "trials": len(results),
        "passed": sum(result.passed for result in results),
        "rest_median_s": round(statistics.median(rests), 3),
        "rest_worst_s": round(max(rests), 3),
        "moved_later": sum(result.moved_later for result in results),
        "commanded_again": len(again),
        "again_median_s": round(statistics.median(again), 2) if again else None,
        "each": [asdict(result) for result in results],
    }


def main() -> None:
    """Run all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", choices=tuple(ROBOTS), action="append")
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    matrix: dict[str, object] = {}
    for vendor in arguments.robot or tuple(ROBOTS):
        cells = [(process, kind) for process in PROCESSES[vendor] for kind in SIGNALS]
        with TwinProcess(ROBOTS[vendor], "pick_place_table", seed=1) as twin:
            done = trials(twin, ROBOTS[vendor], cells * arguments.trials, arguments.seed, twin.settings)
        for cell in cells:
            results = [result for process, kind, result in done if (process, kind) == cell]
            matrix[f"{vendor} {cell[0]} {cell[1]}"] = summary(results)
    text = json.dumps(matrix, indent=1)
    if arguments.json is not None:
        arguments.json.write_text(text + "\n")
    else:
        print(text)


if __name__ == "__main__":
    main()
