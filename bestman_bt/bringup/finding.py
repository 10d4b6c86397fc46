"""A result of a bring-up step: passed, failed, or not applicable, with measurements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Outcome = Literal["passed", "failed", "does not apply"]


@dataclass(frozen=True)
class CheckFinding:
    """A result for one part or connection, the ``subject``. ``measured``: value by name, in SI units unless the name
    says

    otherwise.
    """

    subject: str
    outcome: Outcome
    text: str
    measured: Mapping[str, float | str] = field(default_factory=dict)


def judged(subject: str, passed: bool, text: str, **measured: float | str) -> CheckFinding:
    """Return a finding that passed or failed."""
    rounded = {name: round(value, 5) if isinstance(value, float) else value for name, value in measured.items()}
    return CheckFinding(subject, "passed" if passed else "failed", text, rounded)


def not_applicable(subject: str, reason: str) -> CheckFinding:
    """Return a finding for a check that does not apply to this robot, with the reason."""
    return CheckFinding(subject, "does not apply", reason)


@dataclass(frozen=True)
class StepResult:
    """All findings of one step."""

    step: str
    findings: tuple[CheckFinding, ...]

    @property
    def outcome(self) -> Outcome:
        """Return failed if any finding failed, passed if any passed, else not applicable."""
        outcomes = {finding.outcome for finding in self.findings}
        return "failed" if "failed" in outcomes else "passed" if "passed" in outcomes else "does not apply"

    @property
    def text(self) -> str:
        """All findings as text."""
        return "; ".join(f"{finding.subject}: {finding.text}" for finding in self.findings)

    @property
    def measured(self) -> dict[str, dict[str, float | str]]:
        """Measured values: subject → name → value."""
        return {finding.subject: dict(finding.measured) for finding in self.findings if finding.measured}
