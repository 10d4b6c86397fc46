"""What a success predicate says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from bestman_bt.runtime import Session
from hal.simulation import GroundTruth


@dataclass(frozen=True)
class Verdict:
    """``holds``: whether the predicate is true. ``why``: in words where it is not. ``metrics``: what was measured."""

    holds: bool
    why: str = ""
    metrics: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Evidence:
    """What a predicate judges by, after the rest time.

    ``before``: name → position at the beginning of the rest, of each object that the task names and that is there.
    ``driven``: metres that the base has driven.
    """

    session: Session
    truth: GroundTruth
    before: dict[str, tuple[float, float, float]]
    driven: float = 0.0


Predicate = Callable[[Evidence], Verdict]


def joined(verdicts: Iterable[Verdict]) -> Verdict:
    """All of them hold, or what is wrong with any."""
    told = list(verdicts)
    metrics = {name: value for verdict in told for name, value in verdict.metrics.items()}
    return Verdict(all(v.holds for v in told), "; ".join(v.why for v in told if not v.holds), metrics)
