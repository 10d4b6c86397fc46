"""Evaluations whose processes are killed, and whose disk fills, at random moments: what is lost, doubled or false.

    python -m benchmarks.chaos --runs 20 --seed 1 --json chaos.json      # disk faults mount a small tmpfs: as root

Each run evaluates the same cheap episodes on local processes or on a Ray cluster of three raylets on this machine, and
meets one to three faults. A command that ends early is repeated, as a user would. Afterwards the journal and the
summary are compared, but for times and notes, with those of an evaluation without faults in one process. Signal 9 ends
the driver, a worker or the process of an episode, a raylet (another one joins) or the head (a new cluster is started);
the disk of the evaluation's folder gets room before the command is repeated. Needs the extra ``ray``.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import psutil

from bestman_bt.evaluation.code_version import commit
from bestman_bt.evaluation.shards import TIMES
from bestman_bt.evaluation.versions import versions
from tests.evaluation.launchers.ray_cluster import OPTIONS, RayCluster

TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Work/></BehaviorTree></root>'
TASK = "tree: work.xml\nscene: bench\nrobot: bench_arm\nplugins: [work.py]\n"
WORK = '''
import time

from behaviours.skill import RobotNode
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, StatefulAction


class Work(RobotNode, StatefulAction):
    """Compute for a while; how long, and whether it succeeds, follows from the seed."""

    def on_start(self) -> int:
        self.ticks = int(self.skills.rng.integers(5, 25))
        return RUNNING

    def on_running(self) -> int:
        end = time.process_time() + 0.02
        while time.process_time() < end:
            pass
        self.ticks -= 1
        if self.ticks:
            return RUNNING
        return SUCCESS if self.skills.rng.random() < 0.8 else FAILURE

    def on_halted(self) -> None: ...
'''
VICTIMS = {"local": ("driver", "worker", "disk"), "ray": ("driver", "worker", "episode", "raylet", "head", "disk")}
LONGEST_WAIT = 1.5
"""Seconds between a number of finished episodes and a fault, at most."""
PATIENCE = 900.0
MOST_COMMANDS = 8
ROOM = "256m"
LEFT_OUT = {*TIMES, "notes", "not_kept"}
"""Keys that two runs of one episode may differ in: times, what was repeated, which files a full disk did not take."""


@dataclass
class Fault:
    """What ``victim`` meets ``seconds`` after the journal has ``episodes``; ``met``: whether it was met."""

    victim: str
    episodes: int
    seconds: float
    met: bool = False


@dataclass
class ChaosRun:
    """One evaluation with its faults, the exit codes of its commands, and what was wrong in the end."""

    number: int
    launcher: str
    faults: list[Fault]
    exit_codes: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    lost: int = 0
    doubled: int = 0
    false: int = 0
    equal_summaries: bool = False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--episodes", type=int, default=30)
    parser.add_argument("--launchers", nargs="+", choices=VICTIMS, default=list(VICTIMS))
    parser.add_argument("--json", type=Path, default=None)
    asked = parser.parse_args()
    os.environ.update(OPTIONS)
    with tempfile.TemporaryDirectory(prefix="bestman_bt_chaos_") as name, ExitStack() as stack:
        bench = _Bench(Path(name), asked.episodes, stack)
        runs = []
        for number in range(asked.runs):
            launcher = asked.launchers[number % len(asked.launchers)]
            run = bench.run(number, launcher, random.Random(f"{asked.seed} {number}"))
            print(json.dumps(asdict(run)), flush=True)
            runs.append(run)
    document = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()} {platform.release()}",
        "versions": {**versions(), "ray": version("ray")},
        "commit": commit(),
        "seed": asked.seed,
        "episodes": asked.episodes,
        "faults_met": Counter(f"{run.launcher} {fault.victim}" for run in runs for fault in run.faults if fault.met),
        **{what: sum(getattr(run, what) for run in runs) for what in ("lost", "doubled", "false")},
        "equal_summaries": sum(run.equal_summaries for run in runs),
        "runs": [asdict(run) for run in runs],
    }
    if asked.json is not None:
        asked.json.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    print(json.dumps({key: value for key, value in document.items() if key != "runs"}, indent=2))
    wrong = document["lost"] or document["doubled"] or document["false"] or document["equal_summaries"] < len(runs)
    sys.exit(1 if wrong else 0)


class _Bench:
    """The episodes, their reference, and the cluster, which is started when it is first needed."""

    def __init__(self, folder: Path, episodes: int, stack: ExitStack) -> None:
        self._folder, self._episodes, self._stack = folder, episodes, stack
        for name, text in {"work.xml": TREE, "work.yaml": TASK, "work.py": WORK}.items():
            (folder / name).write_text(text, encoding="utf-8")
        self._cluster: RayCluster | None = None
        reference = folder / "undisturbed"
        self._start("local", reference, jobs=1).communicate()
        self._results, self._summary = _results(reference), _summary(reference)
        assert len(self._results) == episodes
        self._size = sum(path.stat().st_blocks * 512 for path in reference.rglob("*") if path.is_file())

    def run(self, number: int, launcher: str, rng: random.Random) -> ChaosRun:
        """Evaluate with one to three faults; the first kind of fault goes round, the others are drawn."""
        kinds = VICTIMS[launcher]
        first = kinds[number // len(VICTIMS) % len(kinds)]
        victims = [first, *rng.choices([kind for kind in kinds if kind != "disk"], k=rng.randrange(3))]
        moments = sorted(rng.randrange(self._episodes - 2) for _ in victims)
        faults = [Fault(*one, rng.uniform(0.0, LONGEST_WAIT)) for one in zip(victims, moments, strict=True)]
        run = ChaosRun(number, launcher, faults)
        out = self._folder / f"run_{number}"
        out.mkdir()
        with ExitStack() as stack:
            size = int(self._size * rng.uniform(0.05, 0.95))
            if "disk" in victims:
                stack.enter_context(_small_disk(out, size))
            waiting = list(run.faults)
            while not run.exit_codes or (run.exit_codes[-1] not in (0, 1) and len(run.exit_codes) < MOST_COMMANDS):
                self._command(run, out, waiting)
        return run

    def _command(self, run: ChaosRun, out: Path, waiting: list[Fault]) -> None:
        """Start the command, let it meet the next faults, and wait for its end."""
        process = self._start(run.launcher, out, jobs=2)
        journal, due = out / "out" / "episodes.jsonl", 0.0
        while waiting and waiting[0].victim != "disk" and process.poll() is None:  # a disk is full when it is full
            time.sleep(0.02)
            fault = waiting[0]
            if not due and journal.is_file() and journal.read_bytes().count(b"\n") >= fault.episodes:
                due = time.monotonic() + fault.seconds
            if due and time.monotonic() >= due and self._strike(run, fault.victim, process):
                fault.met, due = True, 0.0
                waiting.pop(0)
        _, told = process.communicate(timeout=PATIENCE)
        run.exit_codes.append(process.returncode)
        if process.returncode not in (0, 1, -signal.SIGKILL):
            run.notes += [line for line in told.splitlines() if line.startswith(("note:", "bestman-bt:"))] or [told]
        if waiting and waiting[0].victim == "disk":
            waiting.pop(0).met = "No space left" in told
            subprocess.run(["mount", "-o", f"remount,size={ROOM}", out], check=True)
        if process.returncode in (0, 1) and "Traceback" not in told:
            self._compare(run, out)

    def _start(self, launcher: str, out: Path, jobs: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "bestman_bt.cli.main", "eval", "work.yaml", "--episodes", str(self._episodes)]
        if launcher == "ray":
            if self._cluster is None:
                self._cluster = self._stack.enter_context(RayCluster())
            command += ["--launcher", "ray", "--address", self._cluster.address]
        command += ["--jobs", str(jobs), "--out", str(out / "out")]
        return subprocess.Popen(command, cwd=self._folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def _strike(self, run: ChaosRun, victim: str, driver: subprocess.Popen[str]) -> bool:
        """Kill a victim; return whether there was one."""
        if victim == "driver":
            driver.kill()
            return True
        parents, word = [driver.pid], "worker_process"
        if run.launcher == "ray":
            if self._cluster is None:  # its head is lost: the command ends, and the next one has a new cluster
                return False
            if victim == "raylet":
                self._cluster.kill_node()
                return True
            if victim == "head":
                self._cluster.kill_head()
                self._cluster = None
                return True
            parents = [node["raylet"] for node in self._cluster.nodes]
            word = "ray::run_in_own_process" if victim == "worker" else word
        for process in _below(parents):
            with suppress(psutil.Error):
                if word in " ".join(process.cmdline()):
                    process.kill()
                    return True
        return False

    def _compare(self, run: ChaosRun, out: Path) -> None:
        lines = _results(out)
        counts = Counter(seed for seed, _ in lines)
        expected = dict(self._results)
        run.lost = len(expected.keys() - counts.keys())
        run.doubled = sum(count - 1 for count in counts.values())
        run.false = sum(expected.get(seed) != result for seed, result in lines)
        run.equal_summaries = _summary(out) == self._summary
        run.notes += json.loads((out / "out" / "summary.json").read_text())["notes"]


@contextmanager
def _small_disk(folder: Path, size: int) -> Iterator[None]:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


def _below(pids: Sequence[int]) -> Iterator[psutil.Process]:
    for pid in pids:
        with suppress(psutil.Error):
            yield from psutil.Process(pid).children(recursive=True)


def _results(folder: Path) -> list[tuple[int, str]]:
    """Return the seed and the result, but for times, of each line of a journal."""
    lines = [json.loads(line) for line in (folder / "out" / "episodes.jsonl").read_text().splitlines()]
    return [(line["seed"], json.dumps(_without(line["result"]))) for line in lines]


def _summary(folder: Path) -> bytes:
    """Return the bytes of a summary without the values of ``LEFT_OUT``."""
    return json.dumps(_without(json.loads((folder / "out" / "summary.json").read_bytes()))).encode()


def _without(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without(item) for key, item in value.items() if key not in LEFT_OUT}
    return [_without(item) for item in value] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
