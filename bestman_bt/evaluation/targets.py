"""Targets of an entry of a suite: asked, found, met or missed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from bestman_bt.evaluation.suite import EntryConfig

ALWAYS_ASKED = ("errors", "false successes", "audit")
"""Targets that every entry of a suite has; one with no others asks nothing of its own."""


@dataclass(frozen=True)
class Target:
    """One target in words: ``what``, the target ``asked`` and the value ``found``."""

    what: str
    asked: str
    found: str
    met: bool


def check_targets(asked: EntryConfig, summary: dict[str, Any]) -> list[Target]:
    """Compare the output of ``summarize`` with the targets of an entry.

    Implied targets: no errors, no false success and a clean audit.
    """
    return list(_targets(asked, summary))


def _targets(asked: EntryConfig, summary: dict[str, Any]) -> Iterator[Target]:
    wanted, succeeded, episodes = asked.successes, summary["succeeded"], summary["episodes"]
    found = f"{succeeded} of {episodes}"
    if wanted is not None and wanted.at_least is not None:
        met = episodes > 0 and succeeded * wanted.of >= wanted.at_least * episodes
        yield Target("successes", f"≥ {wanted.at_least} of {wanted.of}", found, met)
    if wanted is not None and wanted.at_most is not None:
        met = episodes > 0 and succeeded * wanted.of <= wanted.at_most * episodes
        yield Target("successes", f"≤ {wanted.at_most} of {wanted.of}", found, met)
    for metric, limits in asked.accuracy.items():
        for statistic, limit in (("median", limits.median), ("p95", limits.p95)):
            if limit is not None:
                measured = summary["accuracy"].get(metric)
                value = measured[statistic] if measured else None
                told = f"{value:.2f}" if value is not None else "not measured"
                yield Target(f"{metric} {statistic}", f"≤ {limit:g}", told, value is not None and value <= limit)
    if asked.real_time_factor is not None:
        factor = summary["real_time_factor"]
        yield Target(
            "real-time factor", f"≥ {asked.real_time_factor:g}", f"{factor:.1f}", factor >= asked.real_time_factor
        )
    if asked.causes:
        other = [f"{count} {code}" for code, count in summary["causes"].items() if code not in asked.causes]
        found = ", ".join(other) or "no other"
        yield Target("causes", f"only {', '.join(asked.causes)}", found, not other)
    yield Target("errors", "0", str(summary["errors"]), summary["errors"] == 0)
    false = summary["false_successes"]
    yield Target("false successes", "0", str(false), false == 0)
    clean = summary["audit_clean"]
    yield Target("audit", "clean", "clean" if clean else f"seeds {summary['unclean_seeds']}", clean)
