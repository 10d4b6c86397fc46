"""Predicates of goals and declarations: their evaluation by belief, and by ground truth.

Execution uses only the belief: for an unseen object only ``unseen`` is true.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules

from bestman_bt import facts
from bestman_bt.world_model.world_model import WorldModel


@dataclass(frozen=True)
class Beliefs:
    """The input of predicates. ``tucked``: whether the arm is in its driving posture, from encoders."""

    world: WorldModel
    tucked: bool = True


@dataclass(frozen=True)
class Predicate:
    """A predicate. ``parameters``: name → type. ``words``: its meaning, with parameters in braces.

    ``holds``: evaluates the belief, arguments in the order of the parameters; None: true once an ability has achieved
    it. ``means``: the condition that it abbreviates, if any. ``excludes``: facts that exclude it; ``_`` is a wildcard:
    ``on({object}, _)``. ``known_if``: the fact without which its negation is merely unknown: an unseen object is not
    known to be off the table. ``negatable``: whether its negation can be a goal. ``why_not``, ``why_still``: from
    ``Evidence``, why it, or its negation, is not true, or empty; the negation has its own criterion: ``not on``
    requires that the object is off the surface, not just misplaced. None: the predicate is only about beliefs, which
    are then used.
    """

    name: str
    parameters: Mapping[str, str]
    words: str
    holds: Callable[..., bool] | None = None
    means: str = ""
    excludes: tuple[str, ...] = ()
    known_if: str = ""
    negatable: bool = True
    why_not: Callable[..., str] | None = None
    why_still: Callable[..., str] | None = None

    @property
    def types(self) -> tuple[str, ...]:
        """Types of the predicate's arguments."""
        return tuple(self.parameters.values())


def shipped_predicates() -> dict[str, Predicate]:
    """Return the predicates of this folder, by name."""
    files = [found.name for found in iter_modules(facts.__path__, "bestman_bt.facts.") if not found.ispkg]
    modules = map(import_module, files)
    made = [value for module in modules for value in vars(module).values() if isinstance(value, Predicate)]
    return {predicate.name: predicate for predicate in made}
