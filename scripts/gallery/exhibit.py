"""One exhibit: a task's run, its film and its still."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.run import load_run
from bestman_bt.configuration.task import load_task
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.film.filmed_run import FilmedRun, read_filmed_run
from bestman_bt.evaluation.film.rendering import (
    ReplayScene,
    Shot,
    best_frame,
    caption,
    captioned,
    plan_shot,
    write_film,
    write_still,
)
from bestman_bt.evaluation.run_folder import make_run_folder

TRIES = 5
SIZE = (560, 420)
STILL_SIZE = (960, 720)


def make(task: str, seed: int, folder: Path) -> dict[str, Any]:
    """Run and film one task; return the facts for the page."""
    why = ""
    for tried in range(seed, seed + TRIES):
        with TemporaryDirectory() as name:
            config = load_run(task, seed=tried)
            run_folder = make_run_folder(config, Path(name))
            result = run_episode(config, run_folder)
            if result.success:
                speed = _film(read_filmed_run(run_folder), folder / task)
                break
        why = result.failure.why if result.failure else str(result.outcome)
        print(f"{task}, seed {tried}: {why}", flush=True)
    else:
        return {"description": load_task(task).description, "failed": f"seeds {seed} to {seed + TRIES - 1}: {why}"}
    print(f"{task}, seed {tried}: filmed", flush=True)
    return {
        "description": load_task(task).description,
        "seed": tried,
        "sim_time_s": round(result.sim_time_s, 1),
        "speed": round(speed, 1),
        "metrics": {name: round(value, 1) for name, value in result.metrics.items()},
        "max_penetration_mm": result.audit["max_penetration_mm"],
    }


def _film(run: FilmedRun, target: Path) -> float:
    """Write ``target``.jpg and ``target``.mp4; return the factor by which the film is faster than the run."""
    with ReplayScene(run) as stage:
        shot = plan_shot(run, stage)
        best = best_frame(run, shot, stage)
        stage.set(shot.snapshots[best])
        write_still(stage.picture(shot.view(best), *STILL_SIZE, oversampling=2), target.with_suffix(".jpg"))
        write_film(_frames(run, shot, stage), target.with_suffix(".mp4"))
    return shot.speed


def _frames(run: FilmedRun, shot: Shot, stage: ReplayScene) -> Iterator[NDArray[np.uint8]]:
    for index, snapshot in enumerate(shot.snapshots):
        stage.set(snapshot)
        yield captioned(stage.picture(shot.view(index), *SIZE), caption(run, shot, shot.times[index]))
