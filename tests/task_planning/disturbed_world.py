"""Symbolic worlds in which something goes wrong on purpose."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestman_bt.task_planning.simulation import SymbolicWorld
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import Action, Literal


@dataclass
class Upset(SymbolicWorld):
    """``after``: action → literals that come to hold after the first time. ``fails``: actions that fail once."""

    after: dict[str, str] = field(default_factory=dict)
    fails: set[str] = field(default_factory=set)
    begun: list[str] = field(default_factory=list)

    def begin(self, action: Action) -> tuple[Literal, ...]:
        """Keeps what was begun, too."""
        self.begun.append(str(action))
        return super().begin(action)

    def finish(self, action: Action) -> str:
        """Fails or is undone, once."""
        if str(action) in self.fails:
            self.fails.remove(str(action))
            return "it slipped"
        super().finish(action)
        for literal in parse_literals(self.after.pop(str(action), "")):
            self.state = self.state - {literal.fact} if literal.negated else self.state | {literal.fact}
        return ""
