"""Make the gallery: one run per task, filmed, with a still and a page.

    python scripts/gallery [TASK …] [--seed 7000] [--jobs 1] [--out docs/gallery]

A task whose run fails is run with the next seeds, at most five; one that never succeeds gets no film, and the page says
so. ``gallery.json`` beside the pictures remembers what each shows; tasks that are not named keep theirs.
"""

from __future__ import annotations

import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from exhibit import make
from page import page

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.task import load_task


def main() -> None:
    """Film the tasks that are asked for, and write the page of all."""
    judged = [name for name in data_names("task") if load_task(name).predicates]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=f"of {', '.join(judged)}; all of them by default")
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[2] / "docs" / "gallery")
    options = parser.parse_args()
    unknown = sorted(set(options.tasks) - set(judged))
    if unknown:
        parser.error(f"no judged task {unknown[0]!r}; there are {', '.join(judged)}")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    options.out.mkdir(parents=True, exist_ok=True)
    memory = options.out / "gallery.json"
    known: dict[str, Any] = json.loads(memory.read_text()) if memory.exists() else {}
    tasks = options.tasks or judged
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        made = {task: pool.submit(make, task, options.seed, options.out) for task in tasks}
        for task, future in made.items():
            known[task] = future.result()
            known = {name: known[name] for name in judged if name in known}
            memory.write_text(json.dumps(known, indent=2) + "\n", encoding="utf-8")
            (options.out.parent / f"{options.out.name}.md").write_text(page(known, options.out.name), encoding="utf-8")


if __name__ == "__main__":
    main()
