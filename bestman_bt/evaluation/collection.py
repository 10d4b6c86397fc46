"""Datasets of judged successes of a task, written in the order of their seeds, whatever runs the episodes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig
from bestman_bt.evaluation.code_version import code_fingerprint, config_fingerprint
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.launchers.launcher import Launcher
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.recorded_episode import ACTION, NODE, STATE, RecordedEpisode, RecordedPart
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.extras import require_extra
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetError, DatasetFolder
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.sensor_parts import CameraPart

ATTEMPTS = "attempts.jsonl"
"""The file of a dataset with a line for each seed that was tried, failures too."""
STAGED = "staged"
"""The folder of a dataset with the episodes that are not in it yet."""


class Collection:
    """A dataset in ``folder`` that grows by judged successes of a simulated task; what it holds already counts.

    ``words``: the language instruction of its episodes. ``cameras``: names of the robot's cameras. ``subtasks``: also
    keep what the running leaves do, in words. Raises ConfigurationError, DatasetError, MissingExtraError.
    """

    def __init__(
        self, config: RunConfig, folder: Path, words: str, cameras: Sequence[str], subtasks: bool = False
    ) -> None:
        setup = prepare_episode(config)
        task, model = config.task, setup.robot_model
        problems = []
        if not (task.predicates or task.goals):
            problems.append(config.problem((), "has no goals: its episodes are not judged"))
        if task.tick_rate != int(task.tick_rate):
            problems.append(config.problem(("tick_rate",), f"should be whole for a dataset, got {task.tick_rate:g} Hz"))
        lenses = {name: camera.intrinsics for name, camera in model.of(CameraPart).items()}
        for name in cameras:
            if name not in lenses:
                why = f"{name!r} is not a camera of {model.name}, which has {', '.join(lenses) or 'none'}"
                problems.append(Problem("--camera", None, "", why))
        if problems:
            raise ConfigurationError(problems)
        if cameras:
            require_extra("--camera", "video")
        self.folder, self._config, self._words = folder, config, words
        parts = DRIVERS.resolve(config.driver)(model, setup.world, seed=config.seed).parts  # not connected
        joints = ElementTree.fromstring(model.urdf).iter("joint")
        sliding = [joint.get("name", "") for joint in joints if joint.get("type") == "prismatic"]
        self._parts = tuple(one for one in (RecordedPart.of(part, sliding) for part in parts.values()) if one)
        names = tuple(name for part in self._parts for name in part.entries)
        units = tuple(unit for part in self._parts for unit in part.units)
        self._frames = DatasetFormat(
            int(task.tick_rate),
            {STATE: names, ACTION: names},
            (NODE,),
            {name: (lenses[name].height, lenses[name].width) for name in cameras},
            model.name,
            {STATE: units, ACTION: units},
            subtasks,
        )
        self._dataset = self._opened()

    @property
    def kept(self) -> int:
        """Return the number of this task's episodes in the dataset."""
        return sum(episode["tasks"] == [self._words] for episode in self._dataset.episodes)

    def collect(
        self, episodes: int, most: int, show: Callable[[RunResult], None], launcher: Launcher | None = None
    ) -> None:
        """Run seeds from the first one until the dataset has ``episodes`` of this task, at most ``most`` seeds.

        Seeds that were tried in an earlier call are passed over. As many seeds are run as successes are missing, then
        as many as are still missing, so that the same seeds are tried whatever runs them. ``show``: receives each
        result, in the order of the seeds. ``launcher``: None: this process.

        Raises ConfigurationError if the launcher refuses the episodes, LauncherLostError if it is lost,
        KeyboardInterrupt after Ctrl-C or a stopped episode. What is in the dataset by then is kept.
        """
        launcher = launcher or LocalProcesses()
        tried, first = self._tried(), self._config.seed
        code, files = code_fingerprint(), config_fingerprint(self._config)
        left = [seed for seed in range(first, first + most) if seed not in tried]
        planned: list[int] = []
        with self._staging():
            try:
                while left and self.kept < episodes:
                    missing = episodes - self.kept
                    ended, finished = len(planned), dict[int, RunResult]()
                    planned += left[:missing]
                    launcher.submit([self._request(seed, code, files) for seed in left[:missing]])
                    left = left[missing:]
                    for place, result in launcher.results():
                        if result.outcome is Outcome.CANCELLED:
                            raise KeyboardInterrupt
                        finished[place] = result
                        while ended in finished:
                            self._keep(planned[ended], finished[ended])
                            show(finished[ended])
                            ended += 1
            finally:
                launcher.cancel()

    def _opened(self) -> DatasetFolder:
        """Return the dataset in the folder, an empty one if the folder has none. Raises DatasetError."""
        frames = self._frames
        empty = DatasetFolder(self.folder, frames.fps, frames.robot, frames.features())
        try:
            there = {path.name for path in self.folder.iterdir()} if self.folder.exists() else set()
        except OSError as error:
            raise DatasetError(f"{self.folder} cannot be a dataset's folder: {error.strerror}") from error
        if "meta" not in there:
            if there and ATTEMPTS not in there:
                raise DatasetError(f"{self.folder} is neither empty nor a dataset")
            return empty
        found = DatasetFolder.read(self.folder)
        if differences := empty.differences(found):
            raise DatasetError(f"{self.folder} holds a dataset of another format: {'; '.join(differences)}")
        return found

    @contextmanager
    def _staging(self) -> Iterator[None]:
        new, staged = not self.folder.exists(), self.folder / STAGED
        shutil.rmtree(staged, ignore_errors=True)  # left by a process that was killed
        staged.mkdir(parents=True)
        try:
            yield
        finally:
            shutil.rmtree(staged, ignore_errors=True)
            if new and not any(self.folder.iterdir()):
                self.folder.rmdir()

    def _request(self, seed: int, code: str, files: str) -> RecordedEpisode:
        return RecordedEpisode(
            self._config.changed(seed=seed),
            code=code,
            files=files,
            staged=(self.folder / STAGED).resolve(),
            frames=self._frames,
            parts=self._parts,
            words=self._words,
        )

    def _keep(self, seed: int, result: RunResult) -> None:
        """Add the episode of a judged success to the dataset, and a line to the attempts."""
        staged, kept = self.folder / STAGED / str(seed), result.success and not result.unearned
        if kept and not staged.is_dir():
            raise LauncherLostError(
                f"the episode of seed {seed} is not in {staged.parent}: --out should be a folder that all machines see "
                "under one path"
            )
        why = result.failure.why if result.failure is not None else result.unearned
        line = {
            "task": self._words,
            "seed": seed,
            "episode": len(self._dataset.episodes) if kept else None,
            "outcome": str(result.outcome),
            "why": why,
            "versions": result.versions,
        }
        if kept:
            self._dataset.append(DatasetFolder.read(staged))
            shutil.rmtree(staged)
        with (self.folder / ATTEMPTS).open("a", encoding="utf-8") as attempts:
            attempts.write(json.dumps(line) + "\n")

    def _tried(self) -> set[int]:
        """Return the seeds that have ended: a process that is killed between its two files has kept its episode."""
        try:
            lines = (self.folder / ATTEMPTS).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            lines = []
        ended = [(line["tasks"][0], line["seed"]) for line in self._dataset.episodes]
        ended += [(line["task"], line["seed"]) for line in map(json.loads, lines)]
        return {seed for task, seed in ended if task == self._words}
