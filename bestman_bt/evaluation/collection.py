"""Datasets of judged successes of a task, and separate ones of failures, in the order of their seeds, independent of
the launcher.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig
from bestman_bt.evaluation.code_version import code_fingerprint, config_fingerprint
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.judge import success_predicates
from bestman_bt.evaluation.launchers.launcher import Launcher
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.recorded_episode import (
    ACTION,
    AUDIT,
    LABELS,
    NODE,
    RUN,
    STATE,
    RecordedEpisode,
    RecordedPart,
    is_kept,
    labels,
)
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.writer_lock import lock_for_writing
from bestman_bt.extras import require_extra
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetError, DatasetFolder
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.sensor_parts import CameraPart

ATTEMPTS = "attempts.jsonl"
"""The file of a dataset with a line for each tried seed, including failures."""
STAGED = "staged"
"""The folder of a dataset with episodes that are not yet part of it."""


class Collection:
    """A dataset in ``folder`` that grows by judged successes of a simulated task; existing episodes count. ``words``:
    the language instruction of its episodes. ``cameras``: names of the robot's cameras. ``subtasks``: also store
    descriptions of the running leaves. ``failures``: also store failed episodes, as a dataset in ``folder/failures``.
    Raises ConfigurationError, DatasetError, MissingExtraError.
    """

    def __init__(
        self,
        config: RunConfig,
        folder: Path,
        words: str,
        cameras: Sequence[str],
        subtasks: bool = False,
        failures: bool = True,
    ) -> None:
        setup = prepare_episode(config)
        task, model = config.task, setup.robot_model
        problems = []
        if not task.predicates:
            known = ", ".join(sorted(success_predicates()))
            why = f"should name what judges the episodes of a dataset, got none; known: {known}"
            problems.append(config.problem(("predicate",), why))
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
        self.folder, self._config, self._words, self._keep_failures = folder, config, words, failures
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
        self._open()

    @property
    def kept(self) -> int:
        """Return the number of this task's episodes in the dataset."""
        return self._of_task(self._dataset)

    @property
    def failures(self) -> int:
        """Return the number of this task's episodes in the dataset of failures."""
        return self._of_task(self._failures)

    def _of_task(self, dataset: DatasetFolder) -> int:
        return sum(episode["tasks"] == [self._words] for episode in dataset.episodes)

    def collect(
        self, episodes: int, most: int, show: Callable[[RunResult], None], launcher: Launcher | None = None
    ) -> list[str]:
        """Run seeds from the first one until the dataset has ``episodes`` of this task, at most ``most`` seeds.

        Seeds that were tried in an earlier call are skipped, unless they ended in an error. Each round runs as many
        seeds as successes are missing, so that the same seeds are tried with any launcher. ``show``: receives each
        result, in the order of the seeds. ``launcher``: None: this process.

        An episode whose workers are lost is listed as an error. Returns a sentence on the seeds of each cause.

        Raises ConfigurationError if the launcher refuses the episodes, another process writes the dataset, its folder
        cannot be made or its list of attempts is damaged, DatasetError if it can no longer be written,
        LauncherLostError if the launcher is lost, KeyboardInterrupt after Ctrl-C or a stopped episode. Episodes already
        in the dataset are kept; results that wait for an earlier seed are not.
        """
        launcher = launcher or LocalProcesses()
        first, planned, lost = self._config.seed, list[int](), dict[int, str]()
        code, files = code_fingerprint(), config_fingerprint(self._config)
        with self._writing():
            tried = self._tried()
            left = [seed for seed in range(first, first + most) if seed not in tried]
            try:
                while left and self.kept < episodes:
                    missing = episodes - self.kept
                    ended, finished = len(planned), dict[int, RunResult]()
                    planned += left[:missing]
                    launcher.submit([self._request(seed, code, files) for seed in left[:missing]])
                    left = left[missing:]
                    for place, result in self._results(launcher, range(ended, len(planned)), lost):
                        if result.outcome is Outcome.CANCELLED:
                            raise KeyboardInterrupt
                        finished[place] = result
                        while ended in finished:
                            self._keep(planned[ended], finished[ended])
                            show(finished[ended])
                            ended += 1
            finally:
                launcher.cancel()
        again = "a later command runs them again if the dataset lacks episodes"
        return [f"{one}; {again}" for one in launcher.without_results(lost)]

    def _results(
        self, launcher: Launcher, places: Iterable[int], lost: dict[int, str]
    ) -> Iterator[tuple[int, RunResult]]:
        """Yield the results, then an error for each place without one, which is added to ``lost``.

        Raises LauncherLostError, after an error for each place that is given up.
        """
        left, end = set(places), None
        try:
            for place, result in launcher.results():
                left.discard(place)
                yield place, result
        except LauncherLostError as error:
            end = error
            left &= launcher.given_up.keys()
        for place in sorted(left):
            lost[place] = self._config.name
            yield place, launcher.requests[place].failed_result(launcher.given_up.get(place, "the launcher lost it"))
        if end is not None:
            raise end

    def _open(self) -> None:
        self._dataset = self._opened(self.folder, ("seed", RUN, AUDIT))
        self._failures = self._opened(self.folder / FAILURES, ("seed", RUN, AUDIT, *LABELS))

    def _opened(self, folder: Path, columns: Iterable[str]) -> DatasetFolder:
        """Return the dataset in a folder, whose rows have ``columns``; an empty one if the folder has none.

        Raises DatasetError.
        """
        frames = self._frames
        empty = DatasetFolder(folder, frames.fps, frames.robot, frames.features())
        try:
            there = folder.exists() and any(folder.iterdir())
        except OSError as error:
            raise DatasetError(f"{folder} cannot be a dataset's folder: {error.strerror}") from error
        if not any((folder / "meta" / name).exists() for name in ("info.json", "episodes")):
            if there and not (self.folder / ATTEMPTS).exists():
                raise DatasetError(f"{folder} is neither empty nor a dataset")
            return empty
        found = DatasetFolder.read(folder)
        if differences := empty.differences(found):
            raise DatasetError(f"{folder} holds a dataset of another format: {'; '.join(differences)}")
        if found.episodes and (missing := set(columns) - set(found.episodes[-1])):
            raise DatasetError(
                f"{folder} was written by another version of collect, or not by it: its episodes lack "
                f"{', '.join(sorted(missing))}; name another folder"
            )
        return found

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Hold the dataset as its only writer, with a new folder for the episodes that are not in it yet.

        Raises ConfigurationError if another process holds it or the folder cannot be written.
        """
        new, path, staged = not self.folder.exists(), self.folder / ATTEMPTS, self.folder / STAGED
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._attempts = path.open("a+b")
        except OSError as error:
            why = f"cannot be a dataset's folder: {error.strerror}"
            raise ConfigurationError([Problem(str(self.folder), None, "", why)]) from error
        try:
            lock_file = lock_for_writing(self._attempts, path, "collect")
            try:
                self._open()
                for dataset in (self._dataset, self._failures):
                    if dataset.episodes:
                        dataset.add((), ())  # what a process that was killed has not written yet follows from the rows
                shutil.rmtree(staged, ignore_errors=True)  # left by a process that was killed
                staged.mkdir()
                self._staged = Path(tempfile.mkdtemp(dir=staged)).resolve()  # workers of that process do not know it
                yield
            finally:
                shutil.rmtree(staged, ignore_errors=True)
                if lock_file is not None:
                    lock_file.unlink()
                if path.stat().st_size == 0 and list(self.folder.iterdir()) == [path]:
                    path.unlink()
                    if new:
                        self.folder.rmdir()
        finally:
            with suppress(OSError):  # it writes what could not be written before
                self._attempts.close()

    def _request(self, seed: int, code: str, files: str) -> RecordedEpisode:
        return RecordedEpisode(
            self._config.changed(seed=seed),
            code=code,
            files=files,
            staged=self._staged,
            frames=self._frames,
            parts=self._parts,
            words=self._words,
            failures=self._keep_failures,
        )

    def _keep(self, seed: int, result: RunResult) -> None:
        """Add a judged success to the dataset, a failure to that of failures, and a line to the attempts.

        Raises DatasetError.
        """
        staged, kept = self._staged / str(seed), is_kept(result, self._keep_failures)
        if kept and not staged.is_dir():
            raise LauncherLostError(
                f"the episode of seed {seed} is not in {staged.parent}: --out should be a folder that all machines see "
                "under one path"
            )
        dataset = self._dataset if result.success else self._failures
        episode = len(dataset.episodes) if kept else None
        try:
            if kept:
                dataset.append(DatasetFolder.read(staged))
                shutil.rmtree(staged)
            self._list(self._words, seed, episode, labels(result), result.versions)
        except OSError as error:
            self._open()
            raise DatasetError(
                f"{self.folder} can no longer be written: {error}; the {len(self._dataset.episodes)} episodes in it "
                "are kept: make room there and repeat the command"
            ) from error

    def _list(
        self, task: str, seed: int, episode: int | None, about: Mapping[str, Any], versions: Mapping[str, Any]
    ) -> None:
        line = {"task": task, "seed": seed, "episode": episode, **about, "versions": versions}
        self._attempts.write(json.dumps(line).encode() + b"\n")
        self._attempts.flush()

    def _tried(self) -> set[int]:
        """Return the seeds that have ended, other than by an error; list those of episodes that are not listed, as
        after a process that was killed between the two files.
        """
        self._attempts.seek(0)
        written = self._attempts.read()
        whole = written[: written.rfind(b"\n") + 1]
        self._attempts.truncate(len(whole))  # without a torn line
        listed, ended, damaged = set(), [], []
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                attempt = json.loads(line)
                key, outcome, episode = (attempt["task"], attempt["seed"]), attempt["outcome"], attempt["episode"]
            except (ValueError, KeyError, TypeError):
                why = "is damaged: remove the line; its seed is run again if the dataset lacks episodes"
                damaged.append(Problem(str(self.folder / ATTEMPTS), number, "", why))
                continue
            if episode is not None:
                listed.add(key)
            if outcome != str(Outcome.ERROR):
                ended.append(key)
        if damaged:
            raise ConfigurationError(damaged)
        success = {**dict.fromkeys(LABELS, ""), "outcome": str(Outcome.SUCCESS)}
        for dataset in (self._dataset, self._failures):
            for episode, row in enumerate(dataset.episodes):
                task, seed = row["tasks"][0], row["seed"]
                ended.append((task, seed))
                if (task, seed) not in listed:
                    self._list(task, seed, episode, {name: row.get(name, success[name]) for name in LABELS}, {})
        return {seed for task, seed in ended if task == self._words}
