"""Open-loop replays: the actions of an episode of a dataset, commanded in its scene with its seed, and judged."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.run import read_run
from bestman_bt.engine import RUNNING, SUCCESS, StatefulAction
from bestman_bt.evaluation.episode import open_judged
from bestman_bt.evaluation.recorded_episode import ACTION, RUN, STATE, measured
from bestman_bt.evaluation.result import RunResult
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetError, DatasetFolder
from hal.api import Gripper, JointGroup, MobileBase, Part


@dataclass(frozen=True)
class OpenLoopReplay:
    """A replay without feedback: its judged result, and the difference of its last state from the recorded one.

    ``difference``: unit → name of the entry that differs most and its difference, rad, m, m/s or rad/s.
    """

    result: RunResult
    difference: Mapping[str, tuple[str, float]]


class CommandActions(StatefulAction):
    """Command one row of (N, n) actions at each tick; ``names``: of the n columns, such as ``arm/panda_joint1``."""

    def __init__(self, parts: Mapping[str, Part], names: Sequence[str], actions: NDArray[np.float64]) -> None:
        super().__init__("open_loop")
        self._actions, self._step = actions, 0
        owners = [name.partition("/")[0] for name in names]
        self._columns = {
            parts[owner]: [column for column, name in enumerate(owners) if name == owner]
            for owner in dict.fromkeys(owners)
        }

    def on_start(self) -> int:
        """Command the first action."""
        self._step = 0
        return self.on_running()

    def on_running(self) -> int:
        """Command the next action; SUCCESS after the last one."""
        if self._step == len(self._actions):
            return SUCCESS
        action, before = self._actions[self._step], self._actions[max(0, self._step - 1)]
        for part, columns in self._columns.items():
            if isinstance(part, JointGroup):
                part.command(positions=action[columns])
            elif isinstance(part, MobileBase):
                part.set_velocity(*action[columns])
            elif isinstance(part, Gripper) and (self._step == 0 or action[columns] != before[columns]):
                part.move(float(action[columns[0]]))
        self._step += 1
        return RUNNING

    def on_halted(self) -> None:
        """Stop the base; joints and gripper hold their set-points."""
        for part in self._columns:
            if isinstance(part, MobileBase):
                part.set_velocity(0.0, 0.0, 0.0)


def replay_open_loop(dataset: DatasetFolder, episode: int) -> OpenLoopReplay:
    """Replay an episode that ``collect`` has recorded.

    Raises DatasetError if its row has no run, ConfigurationError if the run cannot be prepared.
    """
    row, data = dataset.episodes[episode], dataset.data(episode)
    if not row.get(RUN):
        raise DatasetError(f"{dataset.path}: episode {episode} does not say which run it is; collect writes it")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "config.yaml"
        file.write_text(row[RUN], encoding="utf-8")
        config = read_run(file)
    time_limit = (len(data[ACTION]) + 2) / config.task.tick_rate  # the run may have ended at its own, a tick earlier
    config = config.changed(task=replace(config.task, time_limit=time_limit))
    names, units = (dataset.features[ACTION][key] for key in ("names", "units"))
    with open_judged(config) as judged:
        parts = judged.session.robot.parts
        last = _state(parts, names)

        def watch(*_: Any) -> Any:
            def after_tick() -> None:
                last[:] = _state(parts, names)

            return after_tick

        # Rounded, because a limit in single precision may be above that limit.
        tree = CommandActions(parts, names, np.array(data[ACTION], dtype=float).round(6))
        result = judged.run(tree, watch=watch)
    found: dict[str, tuple[str, float]] = {}
    for name, unit, here, there in zip(names, units, last, data[STATE][-1], strict=True):
        if unit not in found or abs(here - there) > found[unit][1]:
            found[unit] = name, abs(here - there)
    return OpenLoopReplay(result, found)


def _state(parts: Mapping[str, Part], names: Iterable[str]) -> list[float]:
    owners = dict.fromkeys(name.partition("/")[0] for name in names)
    return [value for owner in owners for value in measured(parts[owner])]
