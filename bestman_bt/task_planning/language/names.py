"""Names of things as they are told to a language model: words without room for sentences."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from bestman_bt.task_planning.symbolic import Problem

LONGEST_NAME = 48

_PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_/.]*(-[A-Za-z0-9_/.]+)*")
_OTHER = re.compile(r"[^A-Za-z0-9_/.]+")
_WORDS = frozenset({"and", "not", "forall"})


@dataclass(frozen=True)
class PlainNames:
    """A one-to-one renaming; a plain name is told as it is, another one (read by a camera, given by a detector) by what
    is left of it. ``told``: name in the world → name that is told.
    """

    told: Mapping[str, str] = field(hash=False)

    @classmethod
    def of(cls, names: Iterable[str]) -> PlainNames:
        """Rename what is not plain; a number keeps apart what would be told alike."""
        names = list(names)
        told = {name: name for name in names if _is_plain(name)}
        taken = set(told)
        for name in names:
            if name in told:
                continue
            stem = _OTHER.sub("_", name).strip("_/.")[:LONGEST_NAME].rstrip("_/.") or "thing"
            candidate, number = stem, 2
            while candidate in taken or candidate in _WORDS:
                candidate, number = f"{stem}_{number}", number + 1
            told[name] = candidate
            taken.add(candidate)
        return cls(told)

    def renamed(self, problem: Problem) -> Problem:
        """The same problem, told in these names."""
        return replace(
            problem,
            objects={self.told[name]: kind for name, kind in problem.objects.items()},
            state=frozenset(fact.bound(self.told) for fact in problem.state),
            goal=tuple(literal.bound(self.told) for literal in problem.goal),
        )

    def back(self, names: Iterable[str]) -> tuple[str, ...]:
        """The names in the world of names that were told."""
        world = {told: name for name, told in self.told.items()}
        return tuple(world[name] for name in names)

    def meant(self, problem: Problem, solved: Problem) -> Problem:
        """``problem`` with the goal of ``solved``, which is told in these names, and without what that rules out."""
        world = {told: name for name, told in self.told.items()}
        left = {fact.bound(world) for fact in solved.state}
        goal = tuple(literal.bound(world) for literal in solved.goal)
        return replace(problem, goal=goal, state=problem.state & left)


def _is_plain(name: str) -> bool:
    return len(name) <= LONGEST_NAME and name not in _WORDS and _PLAIN.fullmatch(name) is not None
