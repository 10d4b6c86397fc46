"""What the first event of a run tells."""

from __future__ import annotations

import os
import time
from pathlib import Path

from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.setup import Setup
from hal.parts import SimulatedClock


def describe_run(setup: Setup, executor: Executor, folder: Path | None) -> RunEvent:
    """An execution of this process that begins now."""
    config = setup.config
    return RunEvent(
        task=config.name,
        tree=str(config.task.tree),
        scene=str(config.task.scene),
        robot=str(config.task.robot),
        seed=config.seed,
        folder="" if folder is None else str(folder.resolve()),
        pid=os.getpid(),
        started=time.time(),
        tick_rate=1.0 / executor.period,
        clock="simulated" if isinstance(executor.clock, SimulatedClock) else "real",
    )
