"""Run folders for tests: written by the real writers, or spoilt on purpose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from behaviours.failure import NodeFailure
from bestman_bt.engine import load_tree
from bestman_bt.engine.clock import EngineClock
from bestman_bt.engine.status import RUNNING
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.records.events import EndEvent, Event, ImageEvent, LogEvent, RunEvent, StatesEvent
from bestman_bt.records.writer import RunLogWriter

HOSTILE = "<script>alert(1)</script>"
TREE = """
<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence name="work">
      <SubTree ID="Inner" name="approach"/>
      <Fallback><ForceFailure><Sleep name="&lt;script&gt;alert(1)&lt;/script&gt;" msec="200"/></ForceFailure>
        <Sleep name="second try" msec="400"/></Fallback>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Inner"><Sleep name="drive" msec="1000"/></BehaviorTree>
</root>
"""
AUDIT = {
    "teleports": 0,
    "grasp_constraints": 0,
    "ground_truth_reads": 0,
    "tampering": 0,
    "object_follows_open_hand": 0,
    "collisions": 0,
    "max_penetration_mm": 0.2,
    "max_penetration_pair": ["cup", "table"],
}


class SteppedClock(EngineClock):
    """Time passes where the tree sleeps, and nowhere else."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep(self, duration: float) -> None:
        self.time += duration


def write_run(
    folder: Path,
    *,
    seed: int = 1,
    task: str = "fetch_cup",
    success: bool = True,
    outcome: Outcome | None = None,
    why: str = "the cup slipped",
    killed: bool = False,
    events: tuple[Event, ...] = (),
) -> Path:
    """A run as an executor leaves it; ``killed``: before its end."""
    folder.mkdir(parents=True)
    (folder / "config.yaml").write_text(f"name: {task}\ntask:\n  robot: diff_panda\n  scene: kitchen\nseed: {seed}\n")
    clock = SteppedClock()
    tree = load_tree(TREE, clock=clock)
    run = RunEvent(task, "tree", "kitchen", "diff_panda", seed, str(folder), 1, 1.7e9, 20.0, "simulated")
    log = RunLogWriter(folder, tree, run)
    log.write(run)
    tree.subscribe(lambda changes: log.write(StatesEvent(changes.stamp, 0, list(changes))))
    for _ in range(5 if killed else 60):
        if tree.tick_exactly_once() != RUNNING:
            break
        clock.sleep(0.05)
    for event in events:
        log.write(event)
    if not killed:
        failure = None if success else NodeFailure(f"{HOSTILE}/Grasp::7", "slipped", f"{why} {HOSTILE}")
        result = RunResult(
            task=task,
            seed=seed,
            success=success,
            outcome=outcome or (Outcome.SUCCESS if success else Outcome.FAILURE),
            tree_status="SUCCESS" if success else "FAILURE",
            predicate=success,
            failure=failure,
            audit=AUDIT,
            metrics={"place_error_mm": 3.0 + seed},
            sim_time_s=clock.time,
            wall_time_s=2.0,
        )
        result.write(folder / "result.json")
        log.write(EndEvent(clock.time, str(result.outcome), result.tree_status))
    log.close()
    return folder


def failure_with_picture(file: str = "pictures/1.jpg") -> tuple[Event, ...]:
    """The events of a failure that a picture was taken of."""
    return (
        LogEvent(
            1.4, "warning", f"out of reach {HOSTILE}", "work/Grasp::7", "no_grasp", where=f"Grasp {HOSTILE} (my.xml:9)"
        ),
        ImageEvent(1.4, "head_camera", 32, 24, file=file, node="work/Grasp::7"),
    )


def picture(path: Path, width: int = 32, height: int = 24) -> None:
    """A red one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((height, width, 3), (200, 30, 30), np.uint8)).save(path)
