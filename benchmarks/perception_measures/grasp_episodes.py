"""One grasp from image to verdict: look, understand, plan, carry out once, and once more where that failed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.grasp_rig import GraspOutcome, GraspRig
from benchmarks.grasp_scenes import GraspScene
from benchmarks.perception_measures.grasp_pictures import save_picture
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.view import View

TARGET = "thing_0"


@dataclass(frozen=True)
class PlannedGrasp:
    """What was seen and decided: no ``candidate`` where none was found, then ``why`` says so.

    ``view``: of the head camera. ``notes``: for judging, by name.
    """

    view: View
    candidate: GraspCandidate | None
    why: str = ""
    notes: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class GraspEpisode:
    """How it went; ``why`` is empty after a success, ``second_why`` after a success at the first or second attempt.

    ``things``: names of the models, the target first. ``cheats``: resets, constraints and the like, 0 in an honest
    run. ``seconds``: of processor time.
    """

    seed: int
    things: tuple[str, ...]
    why: str
    second_why: str
    approach: str
    slip: float
    contacts: tuple[str, ...]
    cheats: int
    notes: dict[str, Any]
    simulated_seconds: float
    seconds: float


def run_episode(
    seed: int, scene: GraspScene, plan: Callable[[GraspRig], PlannedGrasp], pictures: Path | None = None
) -> GraspEpisode:
    """Grasp the thing TARGET of ``scene`` as ``plan`` says; failures are drawn into the folder ``pictures``."""
    start = time.process_time()
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        planned = plan(rig)
        outcome = _carry_out(rig, planned)
        second = outcome.why
        if outcome.why:
            if pictures is not None:
                save_picture(pictures / f"{scene.world.scene}_{seed}.png", rig, planned, outcome, TARGET)
            rig.retreat()
            second = _carry_out(rig, plan(rig)).why
        return GraspEpisode(
            seed=seed,
            things=tuple(placed.model.name for placed in scene.world.objects),
            why=outcome.why,
            second_why=second,
            approach=planned.candidate.approach if planned.candidate else "",
            slip=outcome.slip,
            contacts=outcome.contacts,
            cheats=sum(rig.audit().values()),
            notes=planned.notes,
            simulated_seconds=rig.seconds,
            seconds=time.process_time() - start,
        )


def _carry_out(rig: GraspRig, planned: PlannedGrasp) -> GraspOutcome:
    if planned.candidate is None:
        return GraspOutcome(planned.why)
    return rig.grasp(planned.candidate, TARGET)
