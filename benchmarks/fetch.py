"""Fetches the cup and tells how fast that is, and where the time goes.

Run it with ``python benchmarks/fetch.py [--seeds 900000,900001] [--json]``. Each seed is run twice, without and with
a recording, after a first episode that only warms up. ``real_time_factor`` is simulated over wall time;
``cpu_time_factor`` is simulated over CPU time, which other processes on the machine disturb less. The stages are
sampled: every few milliseconds, the innermost frame that belongs to a stage gets the CPU time since the last sample.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.versions import versions

FIRST_SEED = 900_000
"""Seeds from here on belong to benchmarks; no test uses them."""
SAMPLE_PERIOD = 0.002

PROJECT = f"{Path(__file__).resolve().parents[1]}{os.sep}"
STAGES: dict[str, str | None] = {
    "hal/simulation/simulation.py": "physics",
    "hal/simulation/monitor.py": "monitor",
    "hal/simulation/observation.py": "monitor",
    "hal/simulation/contact_watcher.py": "monitor",
    "hal/simulation/motion_watcher.py": "monitor",
    "hal/simulation/camera.py": "rendering",
    "hal/simulation/lidar.py": "lidar and localisation",
    "hal/simulation/guards.py": None,
    "hal/mujoco/": None,
    "hal/mujoco/world_builder.py": "set-up",
    "hal/pybullet/": None,
    "hal/pybullet/world_builder.py": "set-up",
    "hal/": "control",
    "bestman_bt/control/lidar.py": "lidar and localisation",
    "bestman_bt/control/rgbd.py": "perception",
    "bestman_bt/navigation/localization/": "lidar and localisation",
    "bestman_bt/navigation/local_planning/": "control",
    "bestman_bt/navigation/global_planning/": "planning",
    "bestman_bt/manipulation/": "planning",
    "bestman_bt/perception/": "perception",
    "bestman_bt/control/": "control",
    "bestman_bt/engine/": "tree",
    "bestman_bt/visualization/": "recording",
    "bestman_bt/evaluation/recording.py": "recording",
    "bestman_bt/robot_model/": "set-up",
    "bestman_bt/scene/": "set-up",
    "bestman_bt/configuration/": "set-up",
}
"""Which stage a file or a folder belongs to; the longest entry that fits counts. None, or not here: its caller's."""


@dataclass(frozen=True)
class Episode:
    """One measured episode; seconds."""

    seed: int
    success: bool
    simulated: float
    wall: float
    cpu: float
    stages: dict[str, float]
    clean: bool
    metrics: dict[str, float]


def stage_of(file: str) -> str | None:
    """The stage of a source file, None where its caller's counts."""
    if not file.startswith(PROJECT):
        return None
    path = file[len(PROJECT) :].replace(os.sep, "/")
    fitting = [entry for entry in STAGES if path.startswith(entry)]
    return STAGES[max(fitting, key=len)] if fitting else None


@contextmanager
def sampled_stages() -> Iterator[dict[str, float]]:
    """Seconds of CPU time by stage, added up while the context lasts."""
    seconds: defaultdict[str, float] = defaultdict(float)
    known: dict[str, str | None] = {}
    last = time.process_time()

    def sample(number: int, frame: FrameType | None) -> None:
        nonlocal last
        # Not the period: signals that come while a long call into a library runs arrive as one.
        now = time.process_time()
        spent, last = now - last, now
        while frame is not None:
            file = frame.f_code.co_filename
            if file not in known:
                known[file] = stage_of(file)
            stage = known[file]
            if stage is not None:
                seconds[stage] += spent
                return
            frame = frame.f_back
        seconds["other"] += spent

    before = signal.signal(signal.SIGPROF, sample)
    signal.setitimer(signal.ITIMER_PROF, SAMPLE_PERIOD, SAMPLE_PERIOD)
    try:
        yield seconds
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def measure(seed: int, folder: Path | None, task: str = "fetch_cup", driver: str = "pybullet") -> Episode:
    """Run one episode; with ``folder``, record it there."""
    config = load_run(task, seed=seed, record=folder is not None, driver=driver)
    wall, cpu = time.perf_counter(), time.process_time()
    with sampled_stages() as stages:
        result = run_episode(config, folder)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    clean = all(result.audit.get(cheat) == 0 for cheat in CHEATS)
    return Episode(seed, result.success, result.sim_time_s, wall, cpu, dict(stages), clean, dict(result.metrics))


def summary(episodes: list[Episode]) -> dict[str, Any]:
    """Factors, and seconds of CPU time in an episode by stage."""
    simulated, cpu = sum(e.simulated for e in episodes), sum(e.cpu for e in episodes)
    stages: Counter[str] = Counter()
    for episode in episodes:
        stages.update(episode.stages)
    return {
        "seeds": [e.seed for e in episodes],
        "successes": sum(e.success for e in episodes),
        "real_time_factor": simulated / sum(e.wall for e in episodes),
        "cpu_time_factor": simulated / cpu,
        "simulated_s": simulated / len(episodes),
        "cpu_s": cpu / len(episodes),
        "cpu_s_by_stage": {stage: seconds / len(episodes) for stage, seconds in stages.most_common()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = f"{FIRST_SEED},{FIRST_SEED + 1},{FIRST_SEED + 2}"
    parser.add_argument("--seeds", default=default, help=f"comma-separated, each at least {FIRST_SEED}")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    seeds = [int(seed) for seed in arguments.seeds.split(",")]
    if min(seeds) < FIRST_SEED:
        parser.error(f"seeds below {FIRST_SEED} belong to tests and tuning")
    run_episode(load_run("fetch_cup", seed=FIRST_SEED + 99))
    document: dict[str, Any] = {"without_recording": summary([measure(seed, None) for seed in seeds])}
    with tempfile.TemporaryDirectory() as name:
        folders = {seed: Path(name) / str(seed) for seed in seeds}
        for folder in folders.values():
            folder.mkdir()
        document["with_recording"] = summary([measure(seed, folder) for seed, folder in folders.items()])
    document["machine"] = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
    document["versions"] = versions()
    if arguments.json:
        print(json.dumps(document))
        return
    for title in ("without_recording", "with_recording"):
        figures = document[title]
        print(f"{title.replace('_', ' ')}: {figures['successes']} of {len(seeds)} fetched")
        for key in ("real_time_factor", "cpu_time_factor", "simulated_s", "cpu_s"):
            print(f"  {key:24} {figures[key]:6.2f}")
        for stage, seconds in figures["cpu_s_by_stage"].items():
            print(f"    {stage:22} {seconds:6.2f} s")


if __name__ == "__main__":
    main()
