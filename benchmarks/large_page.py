"""The live page of a large tree, and a monitor that is given many run folders.

    python benchmarks/large_page.py [--nodes 10000] [--folders 10000] [--seconds 10]

Live: every node of the tree changes at 20 Hz while a page is open. ``messages_per_second`` and ``behind_s``, from the
change to the message, depend on what else the machine does; the processor time of the monitor for each tick does not.
Idle: the share of a core that the monitor takes without executors, of one run folder and of many. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.watching import Monitor
from bestman_bt.engine import NodeRegistry, load_tree
from bestman_bt.monitor.watched import WatchedExecution, refuse
from bestman_bt.records.described_tree import describe_tree
from bestman_bt.records.events import RunEvent, StatesEvent
from bestman_bt.records.writer import RunLogWriter

RATE = 20.0
SETTLE = 3.0
"""Seconds until what is measured begins."""


def large_tree(nodes: int) -> Any:
    """A sequence of so many nodes."""
    leaves = "<AlwaysSuccess/>" * (nodes - 1)
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>{leaves}</Sequence></BehaviorTree></root>'
    return load_tree(text, NodeRegistry())


def execute(nodes: int) -> None:
    """Be an executor whose nodes all change at each tick, until it is killed."""
    started, due, tick = time.time(), time.monotonic(), 0
    run = RunEvent("large", "Main", "", "", 0, "", os.getpid(), started, RATE, "real")
    with WatchedExecution(run, describe_tree(large_tree(nodes)), None, refuse) as watched:
        while True:
            tick += 1
            watched.publish_states(time.time() - started, [(uid, 2 + tick % 2) for uid in range(1, nodes + 1)])
            due += 1 / RATE
            time.sleep(max(0.0, due - time.monotonic()))


def processor_time(monitor: Monitor) -> float:
    """Seconds that the monitor has computed."""
    fields = Path(f"/proc/{monitor.process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def live(nodes: int, seconds: float) -> dict[str, Any]:
    """What a page is told of ticks in which all nodes change."""
    late: list[float] = []
    with monitored() as (monitor, folder):
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
        executor = subprocess.Popen([sys.executable, __file__, "--execute", str(nodes)], env=environment)
        try:
            run = monitor.wait()
            with monitor.page(run) as page:
                settled = time.monotonic() + SETTLE
                first = last = 0
                while time.monotonic() < settled or not first:
                    first = json.loads(page.recv()).get("tick", first)
                began, computed = time.monotonic(), processor_time(monitor)
                while time.monotonic() < began + seconds:
                    message = json.loads(page.recv())
                    if message["type"] == "delta" and message["changes"]:
                        late.append(time.time() - run["started"] - message["time"])
                        last = message["tick"]
                took, computed = time.monotonic() - began, processor_time(monitor) - computed
        finally:
            executor.kill()
            executor.wait()
    return {
        "nodes": nodes,
        "messages_per_second": round(len(late) / took, 1),
        "behind_s": {"median": round(statistics.median(late), 3), "worst": round(max(late), 3)},
        "monitor_ms_per_tick": round(1e3 * computed / (last - first), 1),
    }


def idle(folders: int, seconds: float) -> float:
    """The share of a core that a monitor of so many run folders takes while nothing happens."""
    with tempfile.TemporaryDirectory() as name:
        runs, one = Path(name, "runs"), Path(name, "one")
        runs.mkdir()
        one.mkdir()
        run = RunEvent("one", "Main", "", "", 0, str(one), 1, 1.7e9, RATE, "simulated")
        log = RunLogWriter(one, large_tree(10), run)
        log.write(run)
        log.write(StatesEvent(0.05, 1, [(1, 2)]))
        log.close()
        for number in range(folders):
            shutil.copytree(one, runs / f"{number:06}")
        with monitored(str(runs)) as (monitor, _):
            time.sleep(SETTLE)
            computed, began = processor_time(monitor), time.monotonic()
            time.sleep(seconds)
            return round((processor_time(monitor) - computed) / (time.monotonic() - began), 4)


@contextmanager
def monitored(*arguments: str) -> Iterator[tuple[Monitor, Path]]:
    """A monitor, and the folder in which it looks for executors."""
    with tempfile.TemporaryDirectory() as folder:
        monitor = Monitor(Path(folder), *arguments)
        try:
            yield monitor, Path(folder)
        finally:
            monitor.end()


def main() -> None:
    """Measure both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=10_000)
    parser.add_argument("--folders", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--execute", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.execute is not None:
        execute(options.execute)
    document = {
        "live": live(options.nodes, options.seconds),
        "idle_share": {folders: idle(folders, options.seconds) for folders in (1, options.folders)},
        "machine": {"processors": os.cpu_count(), "kind": platform.machine(), "python": platform.python_version()},
        "versions": {name: version(name) for name in ("bestman-bt", "numpy", "pydantic")},
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
