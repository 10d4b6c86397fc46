"""Tasks: which tree, scene and robot; the goal; what counts as success and what the robot may touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from bestman_bt.configuration.checked import check, salvage
from bestman_bt.configuration.data import beside, data_names, find_data
from bestman_bt.configuration.disturbance import DisturbanceConfig, disturbance_faults
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.quantity import (
    Distance,
    Frequency,
    JointPosition,
    Length,
    PositiveAngle,
    PositiveLength,
    PositiveTime,
    Share,
    Time,
)
from bestman_bt.registry import suggestion

T = TypeVar("T")
_TEN_DEGREES = math.radians(10.0)


def _no_more_than_half_a_turn(angle: float) -> float:
    if angle > math.pi + 1e-9:
        raise PydanticCustomError("tolerance", "should be at most 180 deg")
    return angle


AngleTolerance = Annotated[PositiveAngle, AfterValidator(_no_more_than_half_a_turn)]
Count = Annotated[int, Field(ge=0, le=1000)]
TickRate = Annotated[Frequency, Field(le=1000)]  # physics takes steps of about a millisecond


@dataclass(frozen=True)
class GoalConfig:
    """``object``, to be sought on ``source``, shall stand at the world's goal ``name`` on ``surface``.

    Surfaces are named as in the map: ``counter``, ``counter/top`` or, of a drawer, ``drawer_chest/drawer_1``.
    ``object``: of a list of names, the seed chooses one that is there.
    """

    name: str
    object: str | tuple[str, ...]
    source: str
    surface: str


@dataclass(frozen=True)
class OpeningConfig:
    """A door or drawer, ``furniture/name``, shall be open by ``at_least`` and ``at_most`` so far at the end.

    Radians of a door, metres of a drawer.
    """

    articulation: str
    at_least: JointPosition | None = None
    at_most: JointPosition | None = None


@dataclass(frozen=True)
class TidyConfig:
    """All of ``objects`` that are there shall be within a rectangle of ``surface``: ``x``, ``y`` in its frame.

    ``source``: where they are to be sought.
    """

    objects: tuple[str, ...]
    source: str
    surface: str
    x: tuple[Length, Length]
    y: tuple[Length, Length]


@dataclass(frozen=True)
class ReachConfig:
    """The tool shall point down above the world's goal ``goal``, turned as that is, ``height`` metres above its middle.

    Of a range of heights the seed chooses one.
    """

    goal: str
    height: tuple[Length, Length]


@dataclass(frozen=True)
class LiftConfig:
    """``object``, to be sought on ``source``, shall be in the hand, ``height`` metres above where it stood."""

    object: str
    source: str
    height: PositiveLength = 0.05


@dataclass(frozen=True)
class DriveConfig:
    """The base shall drive to a pose that the seed chooses, at least ``distance`` metres from its start.

    ``at_furniture``: the chance that it is 6 cm before a piece of furniture; else there is room to turn.
    """

    at_furniture: Share = 0.5
    distance: Distance = 1.0


@dataclass(frozen=True)
class PlanConfig:
    """The facts of ``goal``, such as ``on(cup, table) and closed(drawer_3)``, shall come about.

    ``told``: object → surface where somebody said that it is. ``planner``, ``builder``, ``limits``: as of the node
    ``ReachGoal``. ``replans``: how often it may be planned anew.
    """

    goal: str
    told: Mapping[str, str] = field(default_factory=dict)
    planner: str = "symbolic"
    builder: str = "reactive"
    limits: str = ""
    replans: Count = 20


@dataclass(frozen=True)
class TolerancesConfig:
    """How near a success has to come: metres, radians (``yaw`` None: any), seconds of rest before it is judged."""

    position: PositiveLength = 0.02
    tilt: AngleTolerance = _TEN_DEGREES
    yaw: AngleTolerance | None = None
    rest_time: Time = 1.0


@dataclass(frozen=True)
class TaskConfig:
    """A task.

    ``goal``: where an object shall go, ``goals``: where several shall; ``opening``, ``tidy``, ``reach``, ``lift``,
    ``drive``, ``plan``: what else is asked.
    ``predicate``: the name of the success predicate, or several that must all hold. ``allowed_contacts``: of what
    skills declare to touch, the only pairs that may, each an object, a piece of furniture, ``fingers``, ``robot`` or
    one of its links; None: all that they declare. ``max_penetration``: metres. ``time_limit``: simulated seconds.
    ``tick_rate``: hertz, 1000 at most. ``known_start``: whether the robot is told, roughly, where on its map it starts.
    ``disturbances``: what somebody does while the robot works.
    ``algorithms``: slot → ``algorithm: NAME`` and its parameters, laid over the shipped default.
    """

    tree: str
    scene: str
    robot: str
    goal: GoalConfig | None = None
    goals: tuple[GoalConfig, ...] = ()
    opening: OpeningConfig | None = None
    tidy: TidyConfig | None = None
    reach: ReachConfig | None = None
    lift: LiftConfig | None = None
    drive: DriveConfig | None = None
    plan: PlanConfig | None = None
    predicate: str | tuple[str, ...] | None = None
    tolerances: TolerancesConfig = field(default_factory=TolerancesConfig)
    allowed_contacts: tuple[tuple[str, str], ...] | None = None
    max_penetration: PositiveLength = 0.002
    time_limit: PositiveTime = 300.0
    tick_rate: TickRate = 20.0
    known_start: bool = True
    disturbances: tuple[DisturbanceConfig, ...] = ()
    algorithms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    plugins: tuple[str, ...] = ()
    description: str = ""

    @property
    def all_goals(self) -> tuple[GoalConfig, ...]:
        """``goal`` and ``goals``."""
        return (self.goal, *self.goals) if self.goal is not None else self.goals

    @property
    def predicates(self) -> tuple[str, ...]:
        """The names of the predicates; none where the task is not judged."""
        if self.predicate is None:
            return ()
        return (self.predicate,) if isinstance(self.predicate, str) else self.predicate

    def algorithm(self, slot: str) -> tuple[str, dict[str, Any]]:
        """Name and parameters of the algorithm in a slot; KeyError names the slots that there are."""
        if slot not in self.algorithms:
            raise KeyError(f"no algorithm is chosen for {slot!r}; there are {', '.join(self.algorithms) or 'none'}")
        parameters = dict(self.algorithms[slot])
        return str(parameters.pop("algorithm")), parameters


def task_document(name_or_path: str | Path, faults: list[Problem] | None = None) -> Document:
    """The document of a task with the default algorithms below it; raises, and ``faults``, as ``read_document``.

    Paths that it names are counted from its file.
    """
    path = find_data("task", name_or_path)
    document = read_document(path, faults)
    for kind in ("tree", "scene", "robot"):
        if isinstance(document.data.get(kind), str):
            document.data[kind] = beside(path, kind, document.data[kind])
    plugins = document.data.get("plugins")
    if isinstance(plugins, list):
        document.data["plugins"] = [str(path.parent / name) if isinstance(name, str) else name for name in plugins]
    slots = document.data.get("algorithms")
    for chosen in slots.values() if isinstance(slots, dict) else ():
        name = chosen.get("algorithm") if isinstance(chosen, dict) else None
        if isinstance(name, str) and ".py:" in name:
            chosen["algorithm"] = str(path.parent / name)
    return with_default_algorithms(document)


def with_default_algorithms(task: Document) -> Document:
    """Lay a task's ``algorithms`` over the shipped default; a slot with another algorithm is replaced as a whole."""
    shipped = read_document(find_data("algorithms", "default"))
    default = Document({"algorithms": shipped.data}, {("algorithms", *path): o for path, o in shipped.origins.items()})
    slots = task.data.get("algorithms")
    for slot, chosen in slots.items() if isinstance(slots, dict) else ():
        given = shipped.data.get(slot)
        if isinstance(chosen, dict) and isinstance(given, dict):
            other = chosen.get("algorithm", given.get("algorithm")) != given.get("algorithm")
            if other:
                default.data["algorithms"].pop(slot)
    return default.merged(task)


def load_task(name_or_path: str | Path) -> TaskConfig:
    """Read a task; a bare name means a shipped one. Raises ConfigurationError."""
    return check_task(task_document(name_or_path))


def check_task(document: Document, faults: list[Problem] | None = None) -> TaskConfig:
    """A task from its document; raises ConfigurationError.

    With ``faults`` what is wrong is added there instead and left out of the task, so that the rest can be checked, too;
    an algorithm that is wrong is then the default.
    """
    task, problems = salvage(document, TaskConfig)
    if task is None:
        raise ConfigurationError(problems)
    default = read_document(find_data("algorithms", "default")).data
    slots, sound = list(default), {**default, **task.algorithms}
    problems += _contradictions(task, document)
    for slot, parameters in task.algorithms.items():
        if slot not in slots:
            problems.append(document.problem(("algorithms", slot), f"unknown slot; {suggestion(slot, slots)}"))
        elif "algorithm" not in parameters:
            message = "'algorithm' is missing: the name of the algorithm"
            problems.append(document.problem(("algorithms", slot), message))
        elif not isinstance(parameters["algorithm"], str):
            message = f"should be the name of an algorithm, got {parameters['algorithm']!r}"
            problems.append(document.problem(("algorithms", slot, "algorithm"), message))
        else:
            continue
        sound[slot] = default.get(slot, parameters)
    if faults is None and problems:
        raise ConfigurationError(problems)
    if faults is not None and problems:
        faults += problems
        task = replace(task, algorithms=sound)
    return task


def _contradictions(task: TaskConfig, document: Document) -> Iterator[Problem]:
    """What types cannot tell."""
    if task.goal is not None and task.goals:
        yield document.problem(("goals",), "'goal' is given too; one goal or several")
    if task.drive is not None and task.all_goals:
        yield document.problem(("drive",), "a goal for an object is given too; both would be the tree's 'goal'")
    if task.plan is not None and (task.drive is not None or task.all_goals or task.reach is not None):
        yield document.problem(("plan",), "another goal is given too; both would be the tree's 'goal'")
    opening, tidy = task.opening, task.tidy
    if opening is not None:
        if opening.at_least is None and opening.at_most is None:
            yield document.problem(("opening",), "one of 'at_least' and 'at_most' should be given")
        elif opening.at_least is not None and opening.at_most is not None and opening.at_least > opening.at_most:
            message = f"should not be less than at_least, {opening.at_least:g}, got {opening.at_most:g}"
            yield document.problem(("opening", "at_most"), message)
    if tidy is not None:
        for axis, (lower, upper) in (("x", tidy.x), ("y", tidy.y)):
            if lower >= upper:
                yield document.problem(("tidy", axis), f"the smaller limit comes first, got [{lower:g}, {upper:g}]")
        if not tidy.objects:
            yield document.problem(("tidy", "objects"), "should name at least one object")
    if task.reach is not None and task.reach.height[0] > task.reach.height[1]:
        lower, upper = task.reach.height
        yield document.problem(("reach", "height"), f"the smaller limit comes first, got [{lower:g}, {upper:g}]")
    yield from disturbance_faults(task.disturbances, document)


def task_of_tree(tree: str) -> str | None:
    """The shipped task that names a shipped tree, the first in the order of names; None if there is none.

    ``tree``: its name or its file. A file of the same name elsewhere is another tree.
    """
    wanted = Path(tree).stem
    is_file = Path(tree).name != tree or Path(tree).suffix
    if wanted not in data_names("tree") or (is_file and Path(tree).resolve() != find_data("tree", wanted).resolve()):
        return None
    for name in data_names("task"):
        if Path(str(read_document(find_data("task", name)).data.get("tree", ""))).stem == wanted:
            return name
    return None


def algorithm_parameters(slot: str, parameters: Mapping[str, Any], dataclass_type: type[T]) -> T:
    """Check an algorithm's parameters against its dataclass; ConfigurationError names ``algorithms.<slot>``."""
    return check(Document(dict(parameters), {(): (f"algorithms.{slot}", None)}), dataclass_type)
