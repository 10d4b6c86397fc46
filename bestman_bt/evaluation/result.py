"""The result of one run: the content of ``result.json``."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from behaviours.failure import NodeFailure

DERIVED = ("judged", "real_time_factor")
"""Keys of ``result.json`` that follow from others."""
NO_GOAL = "not judged: the tree names no goal"


class Outcome(StrEnum):
    """The outcome of a run."""

    SUCCESS = "success"
    FAILURE = "failure"
    CANCELLED = "cancelled"
    ERROR = "error"


@dataclass(frozen=True)
class RunResult:
    """One judged run.

    ``success``: the tree succeeded, the audit is clean and, if judged, the predicate holds. ``predicate``: None if not
    judged; ``not_judged``: why not. ``held_at_start``: whether the predicate held before the first tick, None if not
    judged. ``moved_by_others``: objects, doors and drawers of the goal that a disturbance moved and the robot never
    touched. ``interventions``: manual changes during the run: entries set, results forced. ``pretended``: types of
    leaves that were simulated because they have no code, each with the source of its description. ``not_kept``:
    incomplete recordings, such as ``motion.jsonl`` → why. ``audit``: see ``evaluation.audit``. ``metrics``: name →
    value, for example ``place_error_mm``. ``durations``: simulated seconds by kind of work; overlapping kinds count in
    both.
    """

    task: str
    seed: int
    success: bool
    outcome: Outcome
    tree_status: str
    predicate: bool | None
    failure: NodeFailure | None
    audit: dict[str, Any]
    metrics: dict[str, float]
    sim_time_s: float
    wall_time_s: float
    versions: dict[str, str] = field(default_factory=dict)
    durations: dict[str, float] = field(default_factory=dict)
    not_judged: str = ""
    held_at_start: bool | None = None
    moved_by_others: list[str] = field(default_factory=list)
    not_kept: dict[str, str] = field(default_factory=dict)
    interventions: list[str] = field(default_factory=list)
    pretended: dict[str, str] = field(default_factory=dict)

    @property
    def judged(self) -> bool:
        """Return whether the outcome was compared with a goal."""
        return self.predicate is not None

    @property
    def unearned(self) -> str:
        """Why the success is not due to the robot; empty if it is, or if the run did not succeed."""
        if not self.success:
            return ""
        if self.interventions:
            return f"a person intervened: {'; '.join(self.interventions[:3])}{'; …' * (len(self.interventions) > 3)}"
        if self.held_at_start:
            return "the goal held before the run began"
        moved = ", ".join(f"the {name}" for name in self.moved_by_others)
        return f"a disturbance moved {moved}; the robot never touched it" if moved else ""

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time."""
        return self.sim_time_s / self.wall_time_s if self.wall_time_s > 0 else 0.0

    def _repr_html_(self) -> str:
        """Return a table of what matters, for display in notebooks."""
        rows = {
            "task": f"{self.task}, seed {self.seed}",
            "outcome": str(self.outcome),
            "note": self.unearned,
            "why": "" if self.failure is None else f"{self.failure.named}: {self.failure.why}",
            "judge": self.not_judged,
            "measured": ", ".join(f"{name} {value:.3g}" for name, value in self.metrics.items()),
            "time": f"{self.sim_time_s:.1f} s of the robot's clock, {self.wall_time_s:.1f} s of real time",
        }
        lines = [f"<tr><th>{name}</th><td>{escape(text)}</td></tr>" for name, text in rows.items() if text]
        return f"<table>{''.join(lines)}</table>"

    def to_document(self) -> dict[str, Any]:
        """Return the JSON document, without NaN or infinity."""
        document = {**asdict(self), "outcome": str(self.outcome)}
        document |= {"judged": self.judged, "real_time_factor": round(self.real_time_factor, 3)}
        versions = document.pop("versions")
        plain: dict[str, Any] = _plain({**document, "versions": versions})
        return plain

    @classmethod
    def from_document(cls, document: Any) -> RunResult:
        """Return the result of a document. Raises ValueError naming the field if it is invalid."""
        if not isinstance(document, dict):
            raise ValueError("it is not a JSON object")
        fields = {key: value for key, value in document.items() if key not in DERIVED}
        if isinstance(metrics := fields.get("metrics"), dict):
            fields["metrics"] = {key: math.nan if value is None else value for key, value in metrics.items()}
        try:
            return _adapter().validate_python(fields)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            where = ".".join(str(part) for part in first["loc"])
            raise ValueError(f"{where}: {first['msg']}") from error

    def write(self, path: Path) -> None:
        """Write ``result.json`` atomically."""
        part = path.with_name(path.name + ".part")
        try:
            part.write_text(json.dumps(self.to_document(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@cache
def _adapter() -> TypeAdapter[RunResult]:
    return TypeAdapter(RunResult)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
