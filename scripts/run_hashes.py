"""Hashes of one run of each shipped task: whether a change of the code has changed what the robot does.

.venv/bin/python scripts/run_hashes.py --out before.json
.venv/bin/python scripts/run_hashes.py --compare before.json

A run is its state changes with their times since the start (``transitions.btlog``) and its beliefs at the end
(``world.yaml``). Equal code gives equal hashes on one machine; another processor or release of a library need not.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.run import load_run
from bestman_bt.engine.logs.btlog import read_btlog
from bestman_bt.evaluation.episode import run_episode


def run_hashes(task: str, seed: int) -> dict[str, str]:
    """Run a task once: how it came out, and the hashes of its state changes and of its beliefs."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        result = run_episode(load_run(task, seed=seed), folder)
        changes = repr(list(read_btlog(folder / "transitions.btlog"))).encode()
        beliefs = (folder / "world.yaml").read_bytes()
        return {"outcome": result.outcome.value, "changes": _hash(changes), "beliefs": _hash(beliefs)}


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def main() -> int:
    """Run the tasks in processes of their own; 1 where a run is another than before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", help="shipped tasks; by default all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="where to write the hashes, JSON")
    parser.add_argument("--compare", type=Path, help="hashes of before; exit code 1 where a run is another")
    asked = parser.parse_args()
    tasks = asked.tasks or data_names("task")
    before = json.loads(asked.compare.read_text()) if asked.compare else {}
    found: dict[str, dict[str, str]] = {}
    with ProcessPoolExecutor(asked.jobs) as pool:
        for task, hashes in zip(tasks, pool.map(run_hashes, tasks, [asked.seed] * len(tasks)), strict=True):
            found[task] = hashes
            same = "" if task not in before else "  same" if before[task] == hashes else "  DIFFERENT"
            print(f"{task:30} {' '.join(hashes.values())}{same}", flush=True)
    if asked.out:
        asked.out.write_text(json.dumps(found, indent=2) + "\n")
    return int(any(before[task] != hashes for task, hashes in found.items() if task in before))


if __name__ == "__main__":
    sys.exit(main())
