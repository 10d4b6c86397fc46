"""What being watched costs an executor: 300 nodes at 20 Hz, bare, kept in a run folder, read live, and not read.

    python benchmarks/monitoring.py [--json] [--seconds 10] [--rounds 3] [--work 20]

Tick times are CPU time of the executor's thread from the end of one sleep to the begin of the next; the share of a core
is the CPU time of the whole process beyond that of a bare run. ``--work``: microseconds that each leaf computes, as
skills do that read encoders and beliefs; with 0 only the engine's own work is compared. Also: what an hour of a tree of
100 nodes leaves on the disk. Exit code 1 where a target is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bestman_bt.engine import (
    RUNNING,
    SUCCESS,
    Condition,
    ManualClock,
    NodeRegistry,
    StatefulAction,
    Tree,
    WallClock,
    load_tree,
)
from bestman_bt.monitor.event_stream import Publish
from bestman_bt.records.events import RobotEvent, RunEvent, Topic
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.telemetry import Telemetry

RATE = 20.0
TICK_TARGET, SHARE_TARGET, DISK_TARGET = 1.2, 0.05, 20e6
WAYS = ("bare", "unwatched", "kept", "read", "frozen")
READER = """
import socket, sys
connection = socket.socket(socket.AF_UNIX)
connection.connect(sys.argv[1])
connection.sendall(b'{"do": "subscribe"}\\n')
for line in connection.makefile("rb"):
    pass
"""


class Check(Condition):
    """A guard that holds, and computes for ``context`` seconds."""

    def on_tick(self) -> int:
        _compute(self.context)
        return SUCCESS


class Act(StatefulAction):
    """Runs for 40 ticks, says how far it is and writes it down."""

    OUTPUT_PORTS = {}
    done = 0

    def on_start(self) -> int:
        self.done = 0
        return RUNNING

    def on_running(self) -> int:
        _compute(self.context)
        self.done += 1
        self.feedback_message = f"{self.done} of 40"
        self.board.set("done", self.done)
        return RUNNING if self.done < 40 else SUCCESS


def _compute(seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


class MeasuredClock(WallClock):
    """The wall clock, which notes the CPU time between sleeps."""

    def __init__(self) -> None:
        self.ticks: list[float] = []
        self._woken = 0.0

    def wait(self, dt: float, wake: threading.Event) -> None:
        if self._woken:
            self.ticks.append(time.thread_time() - self._woken)
        super().wait(dt, wake)
        self._woken = time.thread_time()


class Joints:
    """A robot state ten times a second, as a mobile manipulator tells it."""

    def __init__(self) -> None:
        self._publish: Publish | None = None
        self._rng = random.Random(0)

    def begin(self, publish: Publish) -> None:
        self._publish = publish

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        if self._publish is not None and tick % 2 == 0:
            joints = {f"joint_{number}": round(self._rng.uniform(-3, 3), 4) for number in range(12)}
            event = RobotEvent(time, tick, (1.0, round(self._rng.uniform(0, 1), 4), 0.5), (0.01, 0.01), joints)
            self._publish(lambda: (event,))

    def failed(self, time: float, node: str) -> None:
        pass


def watched_tree(nodes: int, clock: WallClock | ManualClock, work: float) -> Tree:
    """A mission of actions in order, a quarter of the nodes, each tick behind as many guards with a remedy each."""
    registry = NodeRegistry()
    registry.register(Check)
    registry.register(Act)
    guards = (nodes - 3) // 4
    actions = nodes - 3 - 3 * guards
    guarded = "".join(
        f'<ReactiveFallback name="guard {n}"><Check name="check {n}"/><Act name="mend {n}"/></ReactiveFallback>'
        for n in range(guards)
    )
    mission = "".join(f'<Act name="act {n}"/>' for n in range(actions))
    tree = load_tree(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main"><Repeat num_cycles="-1"><ReactiveSequence>{guarded}'
        f"<Sequence>{mission}</Sequence></ReactiveSequence></Repeat></BehaviorTree></root>",
        registry,
        clock=clock,
        context=work,
    )
    assert len(tree.nodes) == nodes
    return tree


def described(folder: Path | None) -> RunEvent:
    return RunEvent("benchmark", "Main", "", "", 0, str(folder or ""), os.getpid(), time.time(), RATE, "real")


def run(way: str, seconds: float, work: float) -> tuple[float, float]:
    """The median tick's CPU time, and the CPU time of the whole process, both in seconds."""
    clock = MeasuredClock()
    executor = Executor(watched_tree(300, clock, work), clock, period=1.0 / RATE)
    with ExitStack() as stack:
        if way != "bare":
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory())) if way == "kept" else None
            telemetry = Telemetry(executor, described(folder), folder, sources=(Joints(),))
            stack.enter_context(telemetry)
            path = stack.enter_context(ControlChannel(executor, lambda: None, telemetry).serving())
            if way == "read":
                reader = subprocess.Popen([sys.executable, "-c", READER, str(path)])
                stack.callback(reader.kill)
            if way == "frozen":
                frozen = stack.enter_context(socket.socket(socket.AF_UNIX))
                frozen.connect(str(path))
                frozen.sendall(b'{"do": "subscribe"}\n')
        timer = threading.Timer(seconds, executor.cancel)
        timer.start()
        begun = time.process_time()
        executor.run()
        used = time.process_time() - begun
    return statistics.median(clock.ticks[5:]), used


def measure(seconds: float, rounds: int, work: float) -> dict[str, dict[str, float]]:
    """For each way the best round's tick, compared with the bare one, and the share of a core beyond it."""
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    for _ in range(rounds):
        for way in WAYS:
            found[way].append(run(way, seconds, work))
    ticks = {way: min(tick for tick, _ in results) for way, results in found.items()}
    used = {way: min(cpu for _, cpu in results) for way, results in found.items()}
    return {
        way: {
            "tick_us": round(ticks[way] * 1e6, 1),
            "ratio": round(ticks[way] / ticks["bare"], 3),
            "share_of_a_core": round((used[way] - used["bare"]) / seconds, 4),
        }
        for way in WAYS
    }


def hour_on_disk() -> int:
    """Bytes of the run folder after an hour at 20 Hz with 100 nodes, simulated."""
    clock = ManualClock()
    tree = watched_tree(100, clock, 0.0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        executor = Executor(tree, clock, period=1.0 / RATE, time_limit=3600.0)
        telemetry = Telemetry(executor, described(folder), folder, sources=(Joints(),))

        def keep_pace() -> None:
            while telemetry.waiting > 1000:
                time.sleep(0.01)

        executor.after_tick = keep_pace
        with telemetry:
            telemetry.end_as(executor.run())
        return sum(path.stat().st_size for path in folder.iterdir())


def main() -> int:
    """Measure, tell and compare with the targets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--work", type=float, default=20.0)
    parser.add_argument("--no-disk", action="store_true", help="leave the simulated hour out")
    options = parser.parse_args()
    ways = measure(options.seconds, options.rounds, options.work * 1e-6)
    disk = None if options.no_disk else hour_on_disk()
    met = all(ways[way]["ratio"] <= TICK_TARGET and ways[way]["share_of_a_core"] <= SHARE_TARGET for way in WAYS)
    met = met and (disk is None or disk <= DISK_TARGET)
    if options.json:
        print(json.dumps({"ways": ways, "hour_on_disk_bytes": disk, "work_us": options.work, "met": met}))
    else:
        for way, figures in ways.items():
            print(f"{way:10}", *(f"{name} {value:g}" for name, value in figures.items()))
        print(f"an hour on the disk: {disk / 1e6:.1f} MB" if disk is not None else "")
        print("all targets met" if met else "a target is missed")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
