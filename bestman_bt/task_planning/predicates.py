"""What can be said of the world in a goal or a declaration, and how the robot finds out whether it believes it.

The robot's belief decides, never the world: of what has not been seen nothing is true but ``unseen``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from bestman_bt.engine.own_files import in_words, own_line
from bestman_bt.task_planning.symbolic.facts import parse_fact
from bestman_bt.task_planning.symbolic.problem import Fact, PlanningError
from bestman_bt.world_model import MapFurniture, WorldModel, containers_before, is_open, is_shut

NEAR = 1.2
"""Metres between the middle of the base and the footprint of furniture at which the base stands at it."""


class PredicateError(PlanningError):
    """A predicate of a user has raised: nobody knows whether it holds."""


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
    """

    name: str
    parameters: Mapping[str, str]
    words: str
    holds: Callable[..., bool] | None = None
    means: str = ""
    excludes: tuple[str, ...] = ()
    known_if: str = ""
    negatable: bool = True

    def bound(self, text: str, arguments: Sequence[str]) -> Fact:
        """A fact of its declaration, such as ``known_if``, for the arguments of a fact with this predicate."""
        return parse_fact(text).bound(
            {f"{{{name}}}": value for name, value in zip(self.parameters, arguments, strict=True)}
        )

    def rules_out(self, fact: Fact, other: Fact) -> bool:
        """Whether ``fact``, of this predicate, and ``other`` cannot hold together."""
        return fact != other and any(
            pattern.predicate == other.predicate
            and all(asked in ("_", given) for asked, given in zip(pattern.arguments, other.arguments, strict=True))
            for pattern in (self.bound(text, fact.arguments) for text in self.excludes)
        )

    def holds_in(self, beliefs: Beliefs, arguments: Sequence[str]) -> bool:
        """What ``holds`` says; PredicateError, with file and line, where it raises."""
        assert self.holds is not None
        try:
            return self.holds(beliefs, *arguments)
        except Exception as error:  # a user's function may raise anything; reported with its line
            if not own_line(error):
                raise
            fact = Fact(self.name, tuple(arguments))
            raise PredicateError(f"the predicate of {fact} raised {in_words(error)}") from error

    @property
    def types(self) -> tuple[str, ...]:
        """Types of its arguments."""
        return tuple(self.parameters.values())


def surfaces(world: WorldModel) -> list[str]:
    """The names of all places, ``furniture/surface``."""
    return [f"{piece.name}/{surface.name}" for piece in world.map.furniture.values() for surface in piece.surfaces]


def _on(beliefs: Beliefs, name: str, place: str) -> bool:
    belief = beliefs.world.objects.get(name)
    return belief is not None and _full_name(beliefs.world, belief.surface) == place


def _full_name(world: WorldModel, surface: str | None) -> str | None:
    """``table`` is short for the first surface of the table."""
    if surface is None:
        return None
    furniture, found = world.map.surface(surface)
    return f"{furniture.name}/{found.name}"


def _holding(beliefs: Beliefs, name: str) -> bool:
    return beliefs.world.arm_with(name) is not None


def _located(beliefs: Beliefs, name: str) -> bool:
    return name in beliefs.world.objects or _holding(beliefs, name)


def _behind(beliefs: Beliefs, place: str, container: str) -> bool:
    return container in containers_before(*beliefs.world.map.surface(place))


def _accessible(beliefs: Beliefs, place: str) -> bool:
    return all(is_open(beliefs.world, name) for name in containers_before(*beliefs.world.map.surface(place)))


def _drawer(beliefs: Beliefs, place: str) -> bool:
    return beliefs.world.map.surface(place)[1].leaf is not None


def _near(beliefs: Beliefs, place: str) -> bool:
    furniture, _ = beliefs.world.map.surface(place)
    return _distance_to(furniture, beliefs.world) <= NEAR


def _distance_to(furniture: MapFurniture, world: WorldModel) -> float:
    """Metres from the middle of the base to the footprint."""
    inside = furniture.pose.inverse().apply(world.base.pose.xy[None])[0]
    beyond = [max(0.0, abs(float(at)) - size / 2) for at, size in zip(inside, furniture.footprint, strict=True)]
    return math.hypot(*beyond)


def _unseen(beliefs: Beliefs, name: str, place: str) -> bool:
    return beliefs.world.may_be_on(name, place)


ON = Predicate(
    "on",
    {"object": "object", "place": "place"},
    "the {object} is on (or in) the {place}",
    _on,
    excludes=("on({object}, _)", "holding({object})"),
    known_if="located({object})",
)
HOLDING = Predicate(
    "holding", {"object": "object"}, "the hand holds the {object}", _holding, excludes=("holding(_)", "hand_empty")
)
HAND_EMPTY = Predicate("hand_empty", {}, "the hand is empty", lambda beliefs: not beliefs.world.hands)
LOCATED = Predicate(
    "located",
    {"object": "object"},
    "it is known where the {object} is",
    _located,
    excludes=("unseen({object}, _)",),
    negatable=False,
)
UNSEEN = Predicate(
    "unseen",
    {"object": "object", "place": "place"},
    "it is not known where the {object} is, and it was not looked for at the {place} since",
    _unseen,
)
OPEN = Predicate(
    "open",
    {"container": "container"},
    "the {container} is open far enough to work behind it",
    lambda beliefs, container: is_open(beliefs.world, container),
    excludes=("closed({container})",),
)
CLOSED = Predicate(
    "closed",
    {"container": "container"},
    "the {container} is shut",
    lambda beliefs, container: is_shut(beliefs.world, container),
)
LOCKED = Predicate(
    "locked",
    {"container": "container"},
    "the {container} did not open when it was tried",
    lambda beliefs, container: container in beliefs.world.locked,
)
BLOCKED = Predicate(
    "blocked",
    {"place": "place"},
    "there was nowhere to stand from where the {place} could be reached, and no door or drawer has moved since",
    lambda beliefs, place: place in beliefs.world.blocked,
)
STUCK = Predicate(
    "stuck",
    {"container": "container"},
    "the {container} could not be opened, for no reason that has to last, and no door or drawer has moved since",
    lambda beliefs, container: container in beliefs.world.blocked,
)
BEHIND = Predicate(
    "behind",
    {"place": "place", "container": "container"},
    "the {container} has to be open for the {place} to be reached",
    _behind,
)
ACCESSIBLE = Predicate(
    "accessible",
    {"place": "place"},
    "all that has to be open for the {place} to be reached is open",
    _accessible,
    means="forall c - container: behind({place}, c) -> open(c)",
)
DRAWER = Predicate("drawer", {"place": "place"}, "the {place} moves with a drawer", _drawer)
NEAR_TO = Predicate("near", {"place": "place"}, "the base stands at the {place}", _near)
TUCKED = Predicate("tucked", {}, "the arm is in its posture for driving", lambda beliefs: beliefs.tucked)
