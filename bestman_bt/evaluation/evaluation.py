"""An evaluation: all episodes of a suite, resumable, judged by the suite's targets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.code_version import code_fingerprint, commit, config_fingerprint
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.journal import EpisodeKey, Journal, JournalError, read_episodes
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.seed_map import SeedMap
from bestman_bt.evaluation.shards import KnownDurations, Shard, find_journals, merge_journals
from bestman_bt.evaluation.suite import Suite, SuiteEntry, check_targets
from bestman_bt.evaluation.summary import Summary
from bestman_bt.evaluation.versions import versions

OnResult = Callable[[SuiteEntry, RunResult], None]


class Evaluation:
    """A suite and its finished episodes; a context manager that holds the journal.

    ``folder``: for the journal ``episodes.jsonl`` and, below ``runs``, a run folder per episode; None saves nothing.
    ``keep_old``: finished episodes of other code count if their configuration is equal. ``shard``: the part of the
    episodes to run, distributed by the wall times in ``balance``, if given.
    """

    def __init__(
        self,
        suite: Suite,
        folder: Path | None = None,
        keep_old: bool = False,
        shard: Shard | None = None,
        balance: KnownDurations | None = None,
    ) -> None:
        self.suite = suite
        self.summaries = {entry.name: Summary() for entry in suite.entries}
        """Entry → summary of its finished episodes."""
        self.notes: list[str] = []
        """Remarks that a reader of the figures has to know."""
        self._folder, self._keep_old, self._shard = folder, keep_old, shard
        self._code, self._commit = code_fingerprint(), commit()
        self._configs = {entry.name: config_fingerprint(entry.config) for entry in suite.entries}
        self._codes: list[str] = []
        self._finished = {entry.name: SeedMap() for entry in suite.entries}
        """Entry → seed of a finished episode → index of the code that ran it."""
        self._unsaved: dict[EpisodeKey, RunResult] = {}
        self._planned: Mapping[str, Sequence[int]] = self._round()
        """Entry → seeds."""
        if shard is not None:
            self._planned = self._part(shard, balance)
        self._journal: Journal | None = None
        self._stack = ExitStack()
        self._interrupted = False

    def __enter__(self) -> Evaluation:
        """Open the journal and count what was finished. Raises ConfigurationError if it cannot be used."""
        if self._folder is not None:
            self._journal = self._stack.enter_context(Journal(self._folder / "episodes.jsonl"))
            self.notes += self._journal.notes
            self._take_finished(self._journal)
            while self._plan_further():
                self._take_finished(self._journal)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def run(self, launcher: Launcher | None = None, on_result: OnResult | None = None) -> dict[str, Any]:
        """Run the missing episodes and return the document. Ctrl-C, a stopped episode, a lost launcher or a full disk
        ends it early; episodes whose workers are lost remain missing.

        ``launcher``: None: this process. Raises ConfigurationError if it refuses the episodes.
        """
        launcher = launcher or LocalProcesses()
        planned: list[tuple[SuiteEntry, int]] = []
        submitted: set[tuple[str, int]] = set()
        missed: Iterable[int] = launcher.given_up
        self._interrupted = True
        try:
            while missing := [(one, seed) for one, seed in self._missing() if (one.name, seed) not in submitted]:
                planned += missing
                submitted.update((entry.name, seed) for entry, seed in missing)
                launcher.submit(self._requests(missing))
                for place, result in launcher.results():
                    if result.outcome is Outcome.CANCELLED:
                        raise KeyboardInterrupt
                    entry, seed = planned[place]
                    if seed in self._finished[entry.name]:  # the launcher has yielded it twice
                        continue
                    self._finish(entry, result)
                    if on_result is not None:
                        on_result(entry, result)
                self._plan_further()
            missed = [place for place, (one, seed) in enumerate(planned) if seed not in self._finished[one.name]]
            self._interrupted = bool(missed)
        except KeyboardInterrupt:
            pass
        except (LauncherLostError, JournalError) as error:
            self.notes.append(str(error))
        finally:
            launcher.cancel()
        self.notes += launcher.without_results({place: planned[place][0].name for place in missed})
        self.notes += launcher.notes
        if planned and code_fingerprint() != self._code:
            self.notes.append("the code was changed while the evaluation ran: run it again for figures that count")
        return self.document()

    @property
    def asked(self) -> Counter[str]:
        """Entry → number of planned episodes."""
        return Counter({name: len(seeds) for name, seeds in self._planned.items()})

    def _round(self) -> dict[str, Sequence[int]]:
        """Return the seeds of each entry up to now: all, or as many as the results so far require."""
        precision, planned = self.suite.precision, dict[str, Sequence[int]]()
        for entry in self.suite.entries:
            most = entry.episodes
            if precision is not None and not entry.control:
                failed = self.summaries[entry.name].failed_seeds
                most = precision.episodes([seed not in failed for seed in self._finished[entry.name]], most)
            first = entry.config.seed
            planned[entry.name] = range(first, first + min(most, entry.episodes))
        return planned

    def _part(self, shard: Shard, balance: KnownDurations | None) -> dict[str, Sequence[int]]:
        every = [(name, seed) for name, seeds in self._planned.items() for seed in seeds]
        seconds = None
        if balance is not None:
            seconds = [balance.seconds(self._configs[name], seed) for name, seed in every]
        mine: dict[str, list[int]] = {name: [] for name in self._planned}
        for name, seed in shard.part(every, seconds):
            mine[name].append(seed)
        return {**mine}

    def _plan_further(self) -> bool:
        """Plan the next round of each finished entry of a suite that has a precision to reach; return whether there is
        one.
        """
        if self.suite.precision is None:
            return False
        before, unfinished = self.asked.total(), {entry.name for entry, _ in self._missing()}
        self._planned = {**self._round(), **{name: self._planned[name] for name in unfinished}}
        return self.asked.total() > before

    def _requests(self, planned: Iterable[tuple[SuiteEntry, int]]) -> list[EpisodeRequest]:
        runs = None if self._folder is None else self._folder.resolve() / "runs"
        return [
            EpisodeRequest(entry.config_of(seed), runs, self._code, self._configs[entry.name])
            for entry, seed in planned
        ]

    def merge(self, folders: Iterable[Path]) -> dict[str, Any]:
        """Import the episodes of all journals below the folders, and return the document.

        Raises:
            ConfigurationError: a journal belongs to another suite or, without ``keep_old``, to other code.
        """
        assert self._folder is not None
        assert self._journal is not None
        mine = self._folder / "episodes.jsonl"
        others = {path: read_episodes(path) for path in find_journals(folders) if path.resolve() != mine.resolve()}
        wanted: dict[str, list[Sequence[int]]] = {}
        for name, seeds in self._planned.items():
            wanted.setdefault(self._configs[name], []).append(seeds)
        problems = []
        for path, keys in others.items():
            foreign = sum(not any(key.seed in seeds for seeds in wanted.get(key.config, ())) for key in keys)
            if foreign:
                why = f"{foreign} of {len(keys)} episodes are not of this suite, its settings, its seeds or its files"
                problems.append(Problem(str(path), None, "", why))
            codes = {key.code for key in keys} - {self._code}
            if codes and not self._keep_old:
                why = f"was run with other code ({', '.join(sorted(codes))}, here {self._code}); --keep-old counts it"
                problems.append(Problem(str(path), None, "", why))
        if problems:
            raise ConfigurationError(problems)
        try:
            merge_journals(self._journal, others)
        except JournalError as error:
            self.notes.append(str(error))
            self._interrupted = True
        self._take_finished(self._journal)
        return self.document()

    def document(self) -> dict[str, Any]:
        """Return the current state: totals, and each entry's summary with its targets, met or missed."""
        missing: dict[str, list[int]] = {entry.name: [] for entry in self.suite.entries}
        for entry, seed in self._missing():
            missing[entry.name].append(seed)
        entries = [{**self.entry_document(entry), "missing": missing[entry.name]} for entry in self.suite.entries]
        contradictions = self._contradictions()
        return {
            "evaluation": self.suite.name,
            "description": self.suite.description,
            "file": self.suite.file,
            "until": None if self.suite.precision is None else str(self.suite.precision),
            "shard": None if self._shard is None else str(self._shard),
            "met": all(entry["met"] for entry in entries) and not contradictions,
            "interrupted": self._interrupted,
            "episodes": sum(entry["episodes"] for entry in entries),
            "false_successes": sum(entry["false_successes"] for entry in entries),
            "unearned": sum(len(entry["unearned"]) for entry in entries),
            "audit_clean": all(entry["audit_clean"] for entry in entries),
            "code": self._code,
            "commit": self._commit,
            "notes": list(self.notes),
            "contradictions": contradictions,
            "entries": entries,
            "versions": versions(),
        }

    def _contradictions(self) -> list[str]:
        """Return which episodes that count have several results, and how these differ."""
        known = {} if self._journal is None else self._journal.conflicts
        return [
            f"{entry.name}, seed {key.seed}: {conflict}"
            for entry in self.suite.entries
            for key, conflicts in known.items()
            if key.config == self._configs[entry.name] and key.seed in self._finished[entry.name]
            for conflict in conflicts
        ]

    def finished_entries(self) -> list[FinishedEntry]:
        """Return the results of all entries but the controls."""
        return [
            FinishedEntry(entry.name, entry.config.name, tuple(self._results_of(entry)), entry.settings)
            for entry in self.suite.entries
            if not entry.control
        ]

    def _results_of(self, entry: SuiteEntry) -> list[RunResult]:
        kept = self._unsaved if self._journal is None else self._journal.results
        config = self._configs[entry.name]
        return [kept[EpisodeKey(config, seed, self._codes[code])] for seed, code in self._finished[entry.name].items()]

    def entry_document(self, entry: SuiteEntry) -> dict[str, Any]:
        """Return the summary of one entry; ``met``: all its episodes have ended, and its targets are met or, without
        targets, all succeeded.
        """
        summary = self.summaries[entry.name].document(entry.config.name, entry.config.seed)
        targets = check_targets(entry.asked, summary) if entry.asked is not None else []
        met = all(target.met for target in targets) if targets else not summary["failures"]
        return {
            "name": entry.name,
            "control": entry.control,
            "config": self._configs[entry.name],
            "settings": entry.settings,
            "asked_episodes": self.asked[entry.name],
            "met": met and summary["episodes"] == self.asked[entry.name],
            "targets": [asdict(target) for target in targets],
            **summary,
        }

    def _missing(self) -> Iterator[tuple[SuiteEntry, int]]:
        for entry in self.suite.entries:
            for seed in self._planned[entry.name]:
                if seed not in self._finished[entry.name]:
                    yield entry, seed

    def _take_finished(self, journal: Journal) -> None:
        old = 0

        def finished(entry: SuiteEntry) -> Iterator[EpisodeKey]:
            nonlocal old
            config = self._configs[entry.name]
            for seed in self._planned[entry.name]:
                codes = [] if seed in self._finished[entry.name] else journal.results.codes(config, seed)
                if self._code in codes:
                    yield EpisodeKey(config, seed, self._code)
                elif codes:
                    old += 1
                    if self._keep_old:
                        yield EpisodeKey(config, seed, codes[-1])

        for entry in self.suite.entries:
            for key, result in journal.results.read(finished(entry)):
                self._count(entry, key, result)
        if old:
            end = "and count all the same" if self._keep_old else "and are run again; --keep-old counts them"
            self.notes.append(f"{old} finished episodes were run with other code {end}")

    def _finish(self, entry: SuiteEntry, result: RunResult) -> None:
        key = EpisodeKey(self._configs[entry.name], result.seed, self._code)
        if self._journal is None:
            self._unsaved[key] = result
        else:
            self._journal.add(key, self._commit, result)
        self._count(entry, key, result)

    def _count(self, entry: SuiteEntry, key: EpisodeKey, result: RunResult) -> None:
        if key.code not in self._codes:
            self._codes.append(key.code)
        self._finished[entry.name][result.seed] = self._codes.index(key.code)
        self.summaries[entry.name].add(result)
