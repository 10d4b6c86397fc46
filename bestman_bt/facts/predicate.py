"""What can be said of the world in a goal or a declaration: how the robot finds out whether it believes it, and a judge
whether it is true.

The robot's belief decides, never the world: of what has not been seen nothing is true but ``unseen``.
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
    """What predicates are asked of. ``tucked``: whether the arm is in its posture for driving, by encoders."""

    world: WorldModel
    tucked: bool = True


@dataclass(frozen=True)
class Predicate:
    """``parameters``: name → type. ``words``: what it says, with its parameters in braces.

    ``holds``: decides by beliefs, its arguments in the order of the parameters; None: it holds once an ability has
    brought it about. ``means``: the condition that it is short for, if it is.

    What goals may say of it, with its parameters in braces. ``excludes``: facts other than itself that cannot hold
    together with it; ``_`` is anything: ``on({object}, _)``. ``known_if``: the fact without which its negation is only
    not known: that something is not on the table says nothing while it was never seen. ``negatable``: whether that it
    does not hold is anything to aim at.

    By ``Evidence``, after a run, in words, empty where nothing does: ``why_not`` returns what keeps it from being true,
    ``why_still`` what keeps its negation from being true, by a measure of its own: ``not on`` wants a thing off the
    surface, not just badly put down. None: it is about the robot's beliefs alone, so its own word counts.
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
        """Types of its arguments."""
        return tuple(self.parameters.values())


def shipped_predicates() -> dict[str, Predicate]:
    """Those that the files of this folder make, by name."""
    files = [found.name for found in iter_modules(facts.__path__, "bestman_bt.facts.") if not found.ispkg]
    modules = map(import_module, files)
    made = [value for module in modules for value in vars(module).values() if isinstance(value, Predicate)]
    return {predicate.name: predicate for predicate in made}
