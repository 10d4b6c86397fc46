"""An evaluation on the terminal: a table that fills while it goes on, a line per episode elsewhere."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.markdown import accuracy_words, own_targets
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.suite import Entry


class EvaluationView:
    """Shows an evaluation on ``console``; ``told`` is to be called with each result."""

    def __init__(self, evaluation: Evaluation, console: Console) -> None:
        self._evaluation, self._console = evaluation, console
        self._began = time.perf_counter()
        self._finished_before = self._done()
        self._live: Live | None = None

    def __enter__(self) -> EvaluationView:
        for note in self._evaluation.notes:
            self._console.print(f"note: {note}", highlight=False)
        for entry in self._evaluation.suite.entries:
            if entry.settings:
                told = ", ".join(f"{key}={value}" for key, value in entry.settings.items())
                self._print(f"{entry.name}: {entry.config.name} with {told}")
        if self._finished_before:
            self._console.print(f"{self._finished_before} episodes are finished already", highlight=False)
        if self._console.is_terminal:
            self._live = Live(self._picture(), console=self._console, auto_refresh=False, vertical_overflow="visible")
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.update(self._picture(), refresh=True)
            self._live.stop()

    def told(self, entry: Entry, result: RunResult) -> None:
        """One more episode is done."""
        if not result.success and not entry.control:
            why = result.failure.why if result.failure else str(result.outcome)
            why = f"{result.failure.named}: {why}" if result.failure and result.failure.named else why
            self._print(f"{entry.name}, seed {result.seed}: {why}")
        elif self._live is None or result.unearned or (result.success and entry.control):
            unearned = f", but {result.unearned}" if result.unearned else ""
            self._print(f"{entry.name}, seed {result.seed}: {result.outcome}{unearned}")
        if self._live is not None:
            self._live.update(self._picture(), refresh=True)

    def _print(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def _done(self) -> int:
        return sum(len(results) for results in self._evaluation.results.values())

    def _picture(self) -> RenderableType:
        total = sum(entry.episodes for entry in self._evaluation.suite.entries)
        done, passed = self._done(), time.perf_counter() - self._began
        line = f"{done} of {total} episodes, {passed / 60:.0f} min"
        if done > self._finished_before:
            left = (total - done) * passed / (done - self._finished_before)
            line += f", about {left / 60:.0f} min to go"
        return Group(table(self._evaluation), Text(line, style="dim"))


def table(evaluation: Evaluation) -> Table:
    """How each entry stands."""
    shown = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    shown.add_column("")
    for name in ("run", "well", "95 %", "false", "× real"):
        shown.add_column(name, justify="right", no_wrap=True)
    shown.add_column("targets")
    shown.add_column("median / p95", overflow="ellipsis", no_wrap=True)
    for entry in evaluation.suite.entries:
        document = evaluation.entry_document(entry)
        low, high = document["interval"]
        begun = document["episodes"] > 0
        shown.add_row(
            f"{entry.name} [dim](control)" if entry.control else entry.name,
            f"{document['episodes']}/{entry.episodes}",
            str(document["succeeded"]),
            f"{low:.0%}–{high:.0%}" if begun else "",
            str(document["false_successes"]),
            f"{document['real_time_factor']:.1f}" if begun else "",
            _standing(document) if begun else "",
            accuracy_words(document["accuracy"]),
        )
    return shown


def _standing(document: dict[str, Any]) -> Text:
    """What the episodes up to now would say of the targets."""
    missed = [target["what"] for target in document["targets"] if not target["met"]]
    done = document["episodes"] == document["asked_episodes"]
    if not document["audit_clean"] and "audit" not in missed:
        missed.append("audit")
    if missed:
        return Text(("missed: " if done else "behind: ") + ", ".join(missed), style="red" if done else "yellow")
    return (
        Text("met" if done else "on course", style="green" if done else "dim") if own_targets(document) else Text("–")
    )
