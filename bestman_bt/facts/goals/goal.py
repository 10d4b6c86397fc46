"""What a task may ask for: each kind a subclass of ``Goal``, with its checks, its entries, its judgement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, ClassVar, Generic, TypeVar

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.configuration.document import FieldPath
from bestman_bt.facts.evidence import DrawnTask, Evidence, Verdict
from bestman_bt.registry import suggestion
from bestman_bt.world_model import WorldModel

Asked = TypeVar("Asked")


class Goal(ABC, Generic[Asked]):
    """What one task asks for in one drawn world. ``problems`` come first: the rest relies on there being none."""

    fields: ClassVar[tuple[str, ...]]
    """Of a task's YAML; an error names the first one where it is missing."""
    measures: ClassVar[Mapping[str, tuple[str, ...]]]
    """The predicates that judge it → what each may measure."""

    def __init__(self, task: DrawnTask) -> None:
        self.task, self.config = task, task.config
        self.world, self.world_model, self.robot_model = task.world, task.world_model, task.robot_model
        self.asked: Asked = getattr(task.config.task, self.fields[0])
        """What the task says."""

    @classmethod
    def is_asked(cls, config: RunConfig) -> bool:
        """Whether a task asks for such a thing."""
        return any(getattr(config.task, name) for name in cls.fields)

    @classmethod
    def metric_names(cls, config: RunConfig, predicate: str) -> list[str]:
        """What a predicate may measure in a task."""
        return list(cls.measures[predicate])

    @abstractmethod
    def problems(self) -> Iterator[Problem]:
        """What is wrong in this world or with this robot, such as names that nothing bears."""

    @abstractmethod
    def entries(self) -> dict[str, Any]:
        """Root blackboard entries that the tree gets."""

    def told(self) -> dict[str, str]:
        """Object → surface, by its full name, where the task says that it is."""
        return {}

    def subjects(self) -> list[str]:
        """The objects, doors and drawers whose state it is about."""
        return []

    @abstractmethod
    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Whether one of its predicates is true."""

    def unknown_object(self, path: FieldPath, name: str, absent: Collection[str] = ()) -> Iterator[Problem]:
        """An object that the robot does not know, or not by this name: of several things of one model it gets to see,
        the first bears the model's name.
        """
        models = self.world_model.models
        yield from unknown(self.config, path, name, [*models, *absent], "the robot knows no object")
        model = models[name].name if name in models else name
        if model != name:
            yield self.config.problem(
                path,
                f"the scene has several things of the model {model!r}, which the robot cannot tell from each other: "
                f"write {model!r}, not {name!r}, or give the thing a model of its own",
            )

    def unknown_surface(self, path: FieldPath, name: str) -> Iterator[Problem]:
        """A surface that the map does not have."""
        yield from unknown(self.config, path, name, surface_names(self.world_model), "the map has no surface")

    def unknown_place(self, path: FieldPath, name: str) -> Iterator[Problem]:
        """A goal that the scene does not have."""
        yield from unknown(self.config, path, name, self.world.goals, "the scene has no goal")

    def missing_part(self, part: type, what: str) -> Iterator[Problem]:
        """A part that the robot does not have."""
        if not self.robot_model.of(part):
            message = f"needs {what}, and robot {self.robot_model.name} has none"
            yield self.config.problem(self.fields[:1], message)


def unknown(config: RunConfig, path: FieldPath, value: str, names: Iterable[str], what: str) -> Iterator[Problem]:
    """A name that is not among those that there are: ``the scene has no goal 'plce'; did you mean 'place'?``."""
    there = list(names)
    if value not in there:
        yield config.problem(path, f"{what} {value!r}; {suggestion(value, there)}")


def surface_names(known: WorldModel, inside: bool = True) -> list[str]:
    """Names of furniture and surfaces; without ``inside`` not those of surfaces in drawers and behind doors."""
    pieces = known.map.furniture
    surfaces = [(piece, surface) for piece in pieces.values() for surface in piece.surfaces]
    return [*pieces, *(f"{p.name}/{s.name}" for p, s in surfaces if inside or not p.is_inside(s))]
