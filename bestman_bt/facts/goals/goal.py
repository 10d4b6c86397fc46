"""Goals of tasks: each kind is a subclass of ``Goal``, with its checks, entries and judgement.

A kind is a file of this folder, named by the file; plug-ins add theirs by ``@bestman_bt.registry.goal``.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, ClassVar, Generic, Self, TypeVar

from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.document import Document, FieldPath, dotted
from bestman_bt.configuration.errors import Problem, up_to_unread_field
from bestman_bt.configuration.run import RunConfig
from bestman_bt.facts import goals
from bestman_bt.facts.evidence import DrawnTask, Evidence, Verdict, joined
from bestman_bt.registry import GOALS, UnknownNameError, suggestion
from bestman_bt.world_model.world_model import WorldModel

Asked = TypeVar("Asked")


class Goal(ABC, Generic[Asked]):
    """One entry of a task's ``goals`` in a generated world.

    Call ``problems`` first: the other methods assume that there are none.
    """

    parameters: ClassVar[type]
    """The frozen dataclass of the goal's fields in a task's YAML, ``Asked``."""
    measures: ClassVar[Mapping[str, tuple[str, ...]]]
    """The predicates that judge the goal → the metrics that each may measure."""
    fills: ClassVar[tuple[str, ...]] = ()
    """The root entries that the goal may fill; a task has at most one goal per entry."""
    several: ClassVar[bool] = False
    """Whether a task may have several goals of this kind."""
    needs_nodes: ClassVar[bool] = False
    """Whether reading the goal requires the registry of nodes."""

    def __init__(self, task: DrawnTask, path: FieldPath, asked: Asked) -> None:
        self.task, self.config, self.path = task, task.config, path
        self.world, self.world_model, self.robot_model = task.world, task.world_model, task.robot_model
        self.asked = asked

    @property
    def written(self) -> Mapping[str, Any]:
        """The goal's fields as written in the task, with units."""
        _, index, kind = self.path
        return dict(numbered(self.config.task.goals))[int(index)][str(kind)]

    def fault(self, message: str, *field: str | int) -> Problem:
        """Return a fault of the goal, or of one of its fields."""
        return self.config.problem((*self.path, *field), message)

    @abstractmethod
    def problems(self) -> Iterator[Problem]:
        """Yield faults in this world or for this robot, such as unknown names.

        For a goal with invalid fields, only faults that do not depend on them are reported.
        """

    @abstractmethod
    def entries(self) -> dict[str, Any]:
        """Return the root blackboard entries for the tree."""

    def given_places(self) -> dict[str, str]:
        """Return object → full name of its surface, as given by the task."""
        return {}

    def subjects(self) -> list[str]:
        """Return the objects, doors and drawers whose state the goal is about."""
        return []

    def labels(self) -> list[str]:
        """Return suffixes for the names of the goal's metrics, for tasks with several goals of the kind."""
        return self.subjects()

    @abstractmethod
    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict on one predicate of the goal."""

    @classmethod
    def entries_of(cls, goals: Sequence[Self]) -> dict[str, Any]:
        """Return the root entries of all goals of this kind in a task."""
        return {name: value for goal in goals for name, value in goal.entries().items()}

    @up_to_unread_field
    def unknown_object(self, *field: str | int, absent: Collection[str] = ()) -> Iterator[Problem]:
        """Yield a problem if a field names an object that the robot does not know.

        If several objects share a model, the robot calls the first one by the model's name.
        """
        name = getattr(self.asked, str(field[0]))
        name = dict(numbered(name))[int(field[1])] if len(field) > 1 else name
        models, path = self.world_model.models, (*self.path, *field)
        yield from unknown(self.config, path, name, [*models, *absent], "the robot knows no object")
        model = models[name].name if name in models else name
        if model != name:
            yield self.config.problem(
                path,
                f"the scene has several things of the model {model!r}, which the robot cannot distinguish: "
                f"write {model!r}, not {name!r}, or give the thing its own model",
            )

    @up_to_unread_field
    def unknown_surface(self, field: str) -> Iterator[Problem]:
        """Yield a problem if a field names a surface that the map does not have."""
        name, there = getattr(self.asked, field), surface_names(self.world_model)
        yield from unknown(self.config, (*self.path, field), name, there, "the map has no surface")

    @up_to_unread_field
    def unknown_place(self, field: str) -> Iterator[Problem]:
        """Yield a problem if a field names a goal place that the scene does not have."""
        name = getattr(self.asked, field)
        yield from unknown(self.config, (*self.path, field), name, self.world.goals, "the scene has no goal")

    @up_to_unread_field
    def missing_part(self, part: type, what: str) -> Iterator[Problem]:
        """Yield a problem if the robot does not have a part of type ``part``; ``what`` needs it."""
        if not self.robot_model.of(part):
            yield self.fault(f"needs {what}, and robot {self.robot_model.name} has none")


def shipped_goals() -> dict[str, type[Goal[Any]]]:
    """Return the kinds of goals of this folder, by file name."""
    found: dict[str, type[Goal[Any]]] = {}
    for file in iter_modules(goals.__path__):
        module = import_module(f"{goals.__name__}.{file.name}")
        for kind in vars(module).values():
            if inspect.isclass(kind) and issubclass(kind, Goal) and kind.__module__ == module.__name__ != __name__:
                found[file.name] = kind
    return found


def read_goals(config: RunConfig, faults: list[Problem]) -> Iterator[tuple[type[Goal[Any]], FieldPath, Any]]:
    """Yield kind, place and fields of a task's goals, in order; unreadable ones are added to ``faults``."""
    for index, one in numbered(config.task.goals):
        if len(one) != 1:
            form = "{placed: {object: cup, at: place, source: table, surface: counter}}"
            message = f"should be one kind of goal with its fields, such as {form}"
            faults.append(config.problem(("goals", index), message))
            continue
        ((name, fields),) = one.items()
        path: FieldPath = ("goals", index, name)
        try:
            kind: Any = GOALS.resolve(name)
        except UnknownNameError as error:
            faults.append(config.problem(path, str(error)))
            continue
        asked, problems = salvage(_document(config, path, fields), kind.parameters)
        faults += [replace(one, field=".".join(filter(None, (dotted(path), one.field)))) for one in problems]
        yield kind, path, asked


def goals_of(task: DrawnTask, faults: list[Problem] | None = None) -> tuple[Goal[Any], ...]:
    """Return a task's goals in a generated world; impossible ones are omitted and added to ``faults``. Without a
    registry of nodes, kinds that need one are omitted.
    """
    found: list[Goal[Any]] = []
    filled: dict[str, Goal[Any]] = {}
    wrong: list[Problem] = [] if faults is None else faults
    for kind, path, asked in read_goals(task.config, wrong):
        if kind.needs_nodes and task.registry is None:
            continue
        goal = kind(task, path, asked)
        others = [filled.setdefault(entry, goal) for entry in kind.fills]
        clash = next((one for one in others if one is not goal and not (kind.several and type(one) is kind)), None)
        if clash is not None:
            entry = kind.fills[others.index(clash)]
            wrong.append(
                goal.fault(f"{dotted(clash.path)} is a goal, too, and both would fill the tree's entry {entry!r}")
            )
        found.append(goal)
    return tuple(found)


def _document(config: RunConfig, path: FieldPath, fields: Mapping[str, Any]) -> Document:
    depth, here = len(path), config.problem(path, "")
    origins = {place[depth:]: origin for place, origin in config.written.origins.items() if place[:depth] == path}
    return Document(dict(fields), {(): (here.source, here.line), **origins})


def entries_of(goals: Sequence[Goal[Any]]) -> dict[str, Any]:
    """Return the root entries that a task's goals fill. Raises SceneError if the scene has no free space for a goal."""
    kinds: dict[type[Goal[Any]], list[Goal[Any]]] = {}
    for goal in goals:
        kinds.setdefault(type(goal), []).append(goal)
    return {name: value for kind, each in kinds.items() for name, value in kind.entries_of(each).items()}


def judging(goals: Iterable[Goal[Any]], predicate: str) -> list[Goal[Any]]:
    """Return the goals that a predicate judges."""
    return [goal for goal in goals if predicate in goal.measures]


def judged(goals: Iterable[Goal[Any]], predicate: str, evidence: Evidence) -> Verdict:
    """Return the common verdict of all goals that ``predicate`` judges.

    With several goals, metrics get suffixes, ``place_error_mm_plate``; ``place_error_mm`` is the largest of them.
    """
    each = judging(goals, predicate)
    verdicts = [goal.judged(predicate, evidence) for goal in each]
    if len(verdicts) == 1:
        return verdicts[0]
    both = joined(verdicts)
    metrics = {
        f"{name}_{goal.subjects()[0]}": value
        for goal, verdict in zip(each, verdicts, strict=True)
        for name, value in verdict.metrics.items()
    }
    for name in sorted(both.metrics):
        metrics[name] = max(verdict.metrics[name] for verdict in verdicts if name in verdict.metrics)
    return Verdict(both.holds, both.why, metrics)


def metric_names(goals: Sequence[Goal[Any]], predicates: Iterable[str]) -> list[str]:
    """Return the names of the metrics of a task's judge; for several goals also individually, with suffixes."""
    names = []
    for predicate in predicates:
        each = judging(goals, predicate)
        own = list(each[0].measures[predicate]) if each else []
        labels = [label for goal in each for label in goal.labels()] if len(each) > 1 else []
        names += [*own, *(f"{name}_{label}" for name in own for label in labels)]
    return names


def unknown(config: RunConfig, path: FieldPath, value: str, names: Iterable[str], what: str) -> Iterator[Problem]:
    """Yield a problem if a name is unknown: ``the scene has no goal 'plce'; did you mean 'place'?``."""
    there = list(names)
    if value not in there:
        yield config.problem(path, f"{what} {value!r}; {suggestion(value, there)}")


def surface_names(known: WorldModel, inside: bool = True) -> list[str]:
    """Return the names of furniture and surfaces; without ``inside``, not those in drawers and behind doors."""
    pieces = known.map.furniture
    surfaces = [(piece, surface) for piece in pieces.values() for surface in piece.surfaces]
    return [*pieces, *(f"{p.name}/{s.name}" for p, s in surfaces if inside or not p.is_inside(s))]
