"""What it takes to watch a process of BehaviorTree.CPP by Groot2's protocol: losses, lag, cost, restarts, hostility.

    python benchmarks/watching.py [--seconds 10] [--pairs 10] [--restarts 50] [--only cost restarts]

The process is behaviortreepy with its own C++ publisher: a tree of 1,000 nodes at 100 Hz in which about 10,000 states a
second change. Lost: changes that the run folder lacks. Behind: from a change in the process to the message of the
monitor's page. Cost: processor time of the process, per tick, watched and with the publisher alone, in pairs. Restarts:
from the bound port to the run in the monitor's list. Hostile: what the process of the monitor grows by, in MiB, while a
server sends without end. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.request import urlopen

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bestman_bt.engine import SUCCESS
from bestman_bt.records.reader import read
from tests.rigs.free_port import free_port

NODES, RATE, CHANGES = 1000, 100.0, 50
LARGE = 10_000
Message = dict[str, Any]


def serve(port: int, nodes: int, rate: float, leaves: int) -> None:
    """Be the watched process: each line of standard input is a number of ticks; answers with processor time."""
    import behaviortreepy as cpp

    factory = cpp.BehaviorTreeFactory()
    running = cpp.NodeStatus.RUNNING
    factory.register_simple_stateful_action("Work", lambda node: running, lambda node: running)
    asked = "".join(f'<AlwaysSuccess name="asked{number}"/>' for number in range(leaves))
    idle = "".join(f'<AlwaysSuccess name="idle{number}"/>' for number in range(nodes - leaves - 4))
    factory.register_behavior_tree_from_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence name="top">'
        f'{asked}<Fallback name="last"><Work name="work"/><Sequence name="never">{idle}</Sequence></Fallback>'
        "</ReactiveSequence></BehaviorTree></root>"
    )
    tree = factory.create_tree("Main")
    publisher = cpp.Groot2Publisher(tree, port)
    publisher.set_enabled(True)
    print("ready", flush=True)
    for line in sys.stdin:
        began, tick_began, due = time.process_time(), time.thread_time(), time.monotonic()
        ticks = int(line)
        for _ in range(ticks):
            tree.tick_exactly_once()
            due += 1 / rate
            time.sleep(max(0.0, due - time.monotonic()))
        spent = {"process": time.process_time() - began, "tick": time.thread_time() - tick_began}
        print(json.dumps({name: seconds / ticks for name, seconds in spent.items()}), flush=True)


class Process:
    """The watched process, in its own interpreter."""

    def __init__(self, port: int, nodes: int = NODES, leaves: int = CHANGES) -> None:
        command = [sys.executable, __file__, "--serve", str(port), str(nodes), str(RATE), str(leaves)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._line() == "ready"

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def begin(self, ticks: int) -> None:
        """Tick so often."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{ticks}\n")
        self._process.stdin.flush()

    def spent(self) -> dict[str, float]:
        """Seconds of processor time a tick: of the whole process, and of the thread that ticks."""
        told: dict[str, float] = json.loads(self._line())
        return told

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


class Monitor:
    """``bestman-bt monitor`` in a process of its own; ``folder``: where it looks for executors."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.runs = folder / "runs"
        command = [sys.executable, "-m", "bestman_bt.cli.main", "monitor", "--port", "0", "--no-browser", *arguments]
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "PYTHONPATH": str(Path(__file__).parents[1])}
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().split()[1]

    def live(self) -> list[Message]:
        """The runs that go on."""
        with urlopen(f"{self.address}api/runs") as answer:  # noqa: S310 - our own monitor
            runs: list[Message] = json.load(answer)["runs"]
        return [run for run in runs if run["state"] == "running"]

    def wait(self, but: str = "") -> Message:
        """A run that goes on, other than ``but``."""
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            for run in self.live():
                if run["id"] != but:
                    return run
            time.sleep(0.01)
        raise AssertionError("no process was found within 30 s")

    @contextmanager
    def page(self, run: Message) -> Iterator[Any]:
        """What the page of a browser is sent of a run."""
        from websockets.sync.client import connect

        host = self.address.removeprefix("http://").rstrip("/")
        origin = {"Origin": f"http://{host}"}
        with connect(f"ws://{host}/ws", additional_headers=origin, max_size=None, proxy=None, open_timeout=60) as page:
            page.send(json.dumps({"do": "open", "id": run["id"]}))
            yield page

    def most_memory(self) -> float:
        """The greatest resident size so far, MiB."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024

    def end(self) -> str:
        """Its standard error."""
        self.process.terminate()
        return self.process.communicate()[1]


def connected(port: int, folder: Path) -> Monitor:
    """A monitor that watches and records a port."""
    return Monitor(folder, "--connect", f"groot2://127.0.0.1:{port}", "--runs", str(folder / "runs"))


@contextmanager
def watched(port: int) -> Iterator[Monitor]:
    """A monitor that watches a port."""
    with tempfile.TemporaryDirectory() as folder:
        monitor = connected(port, Path(folder))
        try:
            yield monitor
        finally:
            monitor.end()


def losses_and_lag(seconds: float) -> Message:
    """Watch a run with a page open; what the folder lacks, and how late the page was."""
    port, ticks = free_port(), round(seconds * RATE)
    process = Process(port)
    late: list[float] = []
    with watched(port) as monitor:
        run = monitor.wait()
        with monitor.page(run) as page:
            time.sleep(1.0)
            process.begin(ticks)
            end = time.monotonic() + seconds - 0.5
            while time.monotonic() < end:
                message = json.loads(page.recv())
                if message["type"] == "delta" and message["changes"]:
                    late.append(time.time() - run["started"] - message["time"])
        process.spent()
        time.sleep(1.0)
        process.kill()
        time.sleep(1.0)
        (folder,) = (path for path in monitor.runs.iterdir() if path.is_dir())
        history = read(folder)
    changes = history.states.changes()
    counts = [int(((changes.uids == uid) & (changes.statuses == SUCCESS)).sum()) for uid in range(2, 2 + CHANGES)]
    late.sort()
    return {
        "changes": len(changes),
        "changes_per_second": round(len(changes) / seconds),
        "lost": sum(abs(count - ticks) for count in counts),
        "gaps": [line.message for _, line in history.log if line.message.startswith("a gap")],
        "behind_ms": {
            "median": round(1e3 * statistics.median(late), 1),
            "p95": round(1e3 * late[round(0.95 * (len(late) - 1))], 1),
            "most": round(1e3 * late[-1], 1),
        },
    }


def cost(seconds: float, pairs: int) -> Message:
    """Processor time a tick, watched and with the publisher alone; one process for both of a pair, in turn first."""
    ratios: dict[str, list[float]] = {"process": [], "tick": []}
    alone_us: list[float] = []
    for number in range(pairs):
        port, ticks = free_port(), round(seconds * RATE)
        process = Process(port)
        told: dict[bool, dict[str, float]] = {}
        for is_watched in (True, False) if number % 2 else (False, True):
            if is_watched:
                with watched(port) as monitor:
                    monitor.wait()
                    time.sleep(1.0)
                    process.begin(ticks)
                    told[True] = process.spent()
            else:
                process.begin(ticks)
                told[False] = process.spent()
        process.kill()
        alone_us.append(1e6 * told[False]["tick"])
        for name, values in ratios.items():
            values.append(told[True][name] / told[False][name])
    return {
        "pairs": pairs,
        "tick_alone_us": round(statistics.median(alone_us), 1),
        "tick_ratio": {"median": round(statistics.median(ratios["tick"]), 3), "all": _rounded(ratios["tick"])},
        "process_ratio": {"median": round(statistics.median(ratios["process"]), 3), "all": _rounded(ratios["process"])},
    }


def _rounded(values: list[float]) -> list[float]:
    return [round(value, 3) for value in values]


def restarts(count: int) -> Message:
    """How long after the process serves again its run is listed."""
    port, taken, before = free_port(), [], ""
    with watched(port) as monitor:
        for _ in range(count + 1):
            process = Process(port)
            ready = time.monotonic()
            process.begin(10)
            before = monitor.wait(before)["id"]
            taken.append(time.monotonic() - ready)
            process.kill()
        growth = monitor.most_memory()
    return {"count": count, "median_s": round(statistics.median(taken[1:]), 2), "most_s": round(max(taken[1:]), 2),
            "monitor_mib": round(growth)}  # fmt: skip


def large() -> Message:
    """How long a page waits for a tree of 10,000 nodes."""
    port = free_port()
    process = Process(port, LARGE)
    with watched(port) as monitor:
        began = time.monotonic()
        run = monitor.wait()
        found = time.monotonic() - began
        process.begin(1000)
        with monitor.page(run) as page:
            opened = time.monotonic()
            while (message := json.loads(page.recv()))["type"] != "tree":
                pass
            seen = time.monotonic() - opened
        process.kill()
        return {"nodes": len(message["nodes"]), "found_s": round(found, 2), "tree_sent_s": round(seen, 2),
                "monitor_mib": round(monitor.most_memory())}  # fmt: skip


def hostile() -> Message:
    """What a monitor grows by, and says, while a server sends without end."""
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32) + b"\x04\x06\x05READY"
    frames = {
        "one message of 1 GiB": b"\x02" + (1 << 30).to_bytes(8, "big"),
        "parts without end": b"\x03" + (1 << 24).to_bytes(8, "big") + bytes(1 << 24),
        "nothing": b"",
    }
    told = {}
    for name, frame in frames.items():
        with socket.create_server(("127.0.0.1", 0)) as server:
            thread = threading.Thread(target=_send_without_end, args=(server, greeting, frame), daemon=True)
            thread.start()
            with tempfile.TemporaryDirectory() as folder:
                monitor = connected(server.getsockname()[1], Path(folder))
                time.sleep(0.3)
                before = monitor.most_memory()
                time.sleep(6.0)
                grown = monitor.most_memory() - before
                said = monitor.end().splitlines()
        told[name] = {"grown_mib": round(grown), "said": said[0] if said else ""}
    return told


def _send_without_end(server: socket.socket, greeting: bytes, frame: bytes) -> None:
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            return
        try:
            with connection:
                connection.sendall(greeting)
                connection.settimeout(10.0)
                while frame:
                    connection.sendall(frame)
                time.sleep(10.0)
        except OSError:
            continue


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--restarts", type=int, default=50)
    parser.add_argument("--only", nargs="+", help="watched, cost, restarts, large, hostile")
    parser.add_argument("--serve", nargs=4, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.serve:
        port, nodes, rate, leaves = asked.serve
        serve(int(port), int(nodes), float(rate), int(leaves))
        return
    parts = {
        "watched": lambda: losses_and_lag(asked.seconds),
        "cost": lambda: cost(asked.seconds, asked.pairs),
        "restarts": lambda: restarts(asked.restarts),
        "large": large,
        "hostile": hostile,
    }
    cpu = {"cpu": platform.processor() or platform.machine(), "cpus": os.cpu_count(), "load": os.getloadavg()[0]}
    figures: Message = {
        "machine": cpu,
        "versions": {"python": platform.python_version(), "behaviortreepy": version("behaviortreepy")},
        "tree": {"nodes": NODES, "rate_hz": RATE},
    }
    figures |= {name: measure() for name, measure in parts.items() if name in (asked.only or parts)}
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
