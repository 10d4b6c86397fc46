"""One exhibit: a task's run, its film and its still."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from film import frames, plan_shot, write_film, write_still
from stage import Stage
from track import record

from bestman_bt.configuration import load_task

TRIES = 5


def make(task: str, seed: int, folder: Path) -> dict[str, Any]:
    """Run and film one task; returns what the page tells of it."""
    for tried in range(seed, seed + TRIES):
        track = record(task, tried)
        if track.result.success:
            break
        why = track.result.failure.why if track.result.failure else str(track.result.outcome)
        print(f"{task}, seed {tried}: {why}", flush=True)
    else:
        return {"description": load_task(task).description, "failed": f"seeds {seed} to {seed + TRIES - 1}: {why}"}
    with Stage(track.setup) as stage:
        shot = plan_shot(track, stage)
        write_still(track, shot, stage, folder / f"{task}.jpg")
        write_film(list(frames(track, shot, stage)), folder / f"{task}.mp4")
    print(f"{task}, seed {tried}: filmed", flush=True)
    return {
        "description": load_task(task).description,
        "seed": tried,
        "sim_time_s": round(track.result.sim_time_s, 1),
        "speed": round(shot.speed, 1),
        "metrics": {name: round(value, 1) for name, value in track.result.metrics.items()},
        "max_penetration_mm": track.result.audit["max_penetration_mm"],
    }
