"""Tasks: tree, scene, robot, goal, success criteria, allowed contacts and scripted disturbances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.data import beside, data_names, find_data
from bestman_bt.configuration.document import Document, FieldPath, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, up_to_unread_field
from bestman_bt.configuration.quantity import Frequency, PositiveAngle, PositiveLength, PositiveTime, SmallerFirst, Time
from bestman_bt.registry import suggestion

DisturbanceKind = Literal["moved", "elsewhere", "slips", "shut"]

_NEEDED: Mapping[DisturbanceKind, str] = {
    "moved": "object",
    "elsewhere": "object",
    "slips": "object",
    "shut": "articulation",
}
_POSSIBLE: Mapping[DisturbanceKind, tuple[str, ...]] = {
    "moved": ("distance",),
    "elsewhere": ("surface",),
    "slips": (),
    "shut": ("object",),
}
_OF_ALL = ("kind", "after")


@dataclass(frozen=True)
class DisturbanceConfig:
    """One intervention in a run, triggered by an event; the seed draws time and place.

    ``kind``: ``moved``: after ``object`` was seen and before it is in the hand, it is put ``distance`` metres away on
    its surface. ``elsewhere``: it is put on ``surface``, by default one that the seed chooses. ``slips``: after
    ``object`` was lifted, it falls out of the hand. ``shut``: after the door or drawer ``articulation`` was opened, it
    is pushed shut; with ``object``, only before that object is in the hand. ``after``: the delay, seconds.
    """

    kind: DisturbanceKind
    object: str | None = None
    articulation: str | None = None
    surface: str | None = None
    distance: Annotated[tuple[PositiveLength, PositiveLength], SmallerFirst] = (0.10, 0.30)
    after: Annotated[tuple[Time, Time], SmallerFirst] = (0.0, 0.3)


def disturbance_faults(asked: Sequence[DisturbanceConfig], document: Document) -> Iterator[Problem]:
    """Yield the faults of a task's ``disturbances`` that types cannot express: missing or superfluous fields of a
    kind.
    """
    for index, disturbance in numbered(asked):
        yield from _faults_of_one(disturbance, document, ("disturbances", index))


@up_to_unread_field
def _faults_of_one(disturbance: DisturbanceConfig, document: Document, path: FieldPath) -> Iterator[Problem]:
    kind, written = disturbance.kind, document.data["disturbances"][path[-1]]
    needed = _NEEDED[kind]
    if written.get(needed) is None:
        yield document.problem(path, f"{needed!r} is missing: what kind {kind!r} is done to")
    known = (*_OF_ALL, needed, *_POSSIBLE[kind])
    for name, unset in ((one.name, one.default) for one in fields(disturbance)):  # the file of a run has all fields
        if name not in known and getattr(disturbance, name) != unset:
            yield document.problem((*path, name), f"kind {kind!r} has no {name!r}; it has {', '.join(known)}")


_TEN_DEGREES = math.radians(10.0)


def _no_more_than_half_a_turn(angle: float) -> float:
    if angle > math.pi + 1e-9:
        raise PydanticCustomError("tolerance", "should be at most 180 deg")
    return angle


AngleTolerance = Annotated[PositiveAngle, AfterValidator(_no_more_than_half_a_turn)]
_NOW_IN_GOALS = {
    "drive": "at_goal",
    "goal": "placed",
    "lift": "lifted",
    "opening": "opened",
    "plan": "facts",
    "reach": "tool_at",
    "tidy": "tidied",
}
"""Fields of the old task format, without a list of goals → the kind of goal."""
FIELDS_OF_GOALS = ("goals", *_NOW_IN_GOALS)

_NAMED = ("tree", "scene", "robot")

TickRate = Annotated[Frequency, Field(le=1000)]  # physics takes steps of about a millisecond


@dataclass(frozen=True)
class TolerancesConfig:
    """The tolerances of a success: metres, radians (``yaw`` None: any), seconds of rest before judging."""

    position: PositiveLength = 0.02
    tilt: AngleTolerance = _TEN_DEGREES
    yaw: AngleTolerance | None = None
    rest_time: Time = 1.0


@dataclass(frozen=True)
class Nav2Names:
    """Names in Nav2's configuration, as its trees use them → our algorithms; empty: the configured one."""

    planners: Mapping[str, str] = field(default_factory=dict)
    controllers: Mapping[str, str] = field(default_factory=dict)

    def of(self, slot: str) -> dict[str, str]:
        """Return the names for a slot of ``algorithms``: the shipped ones, overridden by those of the task."""
        if slot == "global_planning":
            return {"GridBased": "", **self.planners}
        return {"FollowPath": "", **self.controllers} if slot == "local_planning" else {}


@dataclass(frozen=True)
class TaskConfig:
    """A task.

    ``goals``: each a goal kind with its fields: ``{placed: {object: cup, at: place, …}}``. The kinds, files of
    ``bestman_bt.facts.goals``, check them when the run is prepared, because plug-ins may add kinds. ``predicate``: the
    success predicate, or several that must all hold. ``allowed_contacts``: the only pairs that may touch, of those that
    skills declare; each an object, a piece of furniture, ``fingers``, ``robot`` or a link; None: all declared contacts.
    ``max_penetration``: metres. ``time_limit``: simulated seconds. ``tick_rate``: hertz, at most 1000. ``known_start``:
    whether the robot receives its approximate start pose on the map. ``disturbances``: interventions during the run.
    ``algorithms``: slot → ``algorithm: NAME`` and its parameters, merged over the shipped default. ``skills``: family →
    parameters of skills that differ from their defaults, checked when the run is prepared. ``nav2``: the meaning of
    Nav2's algorithm names.
    """

    tree: str
    scene: str
    robot: str
    goals: tuple[Mapping[str, Mapping[str, Any]], ...] = ()
    predicate: str | tuple[str, ...] | None = None
    tolerances: TolerancesConfig = field(default_factory=TolerancesConfig)
    allowed_contacts: tuple[tuple[str, str], ...] | None = None
    max_penetration: PositiveLength = 0.002
    time_limit: PositiveTime = 300.0
    tick_rate: TickRate = 20.0
    known_start: bool = True
    disturbances: tuple[DisturbanceConfig, ...] = ()
    algorithms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    skills: Mapping[str, Any] = field(default_factory=dict)
    nav2: Nav2Names = field(default_factory=Nav2Names)
    plugins: tuple[str, ...] = ()
    description: str = ""

    def asked(self, kind: str) -> Mapping[str, Any] | None:
        """Return the fields of the first goal of a kind, as written, or None if there is none."""
        return next((goal[kind] for goal in self.goals if kind in goal), None)

    @property
    def predicates(self) -> tuple[str, ...]:
        """Return the names of the predicates; empty if the task is not judged."""
        if self.predicate is None:
            return ()
        return (self.predicate,) if isinstance(self.predicate, str) else self.predicate

    def algorithm(self, slot: str) -> tuple[str, dict[str, Any]]:
        """Return name and parameters of the algorithm in a slot. Raises KeyError naming the existing slots."""
        if slot not in self.algorithms:
            raise KeyError(f"no algorithm is set for {slot!r}; set: {', '.join(self.algorithms) or 'none'}")
        parameters = dict(self.algorithms[slot])
        return str(parameters.pop("algorithm")), parameters


def task_document(name_or_path: str | Path, faults: list[Problem] | None = None) -> Document:
    """Return the document of a task merged over the default algorithms; ``faults`` and exceptions as for
    ``read_document``. Paths in it are relative to its file.
    """
    path = find_data("task", name_or_path)
    document = read_document(path, faults)
    for kind in _NAMED:
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
    """Overlay a task's ``algorithms`` on the shipped defaults; a slot with another algorithm is replaced as a whole."""
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
    """Return the task of a document. Raises ConfigurationError.

    With ``faults``, faults are added there instead and invalid parts omitted, so that the rest can be checked: an
    invalid algorithm becomes the default, and a missing tree, scene or robot is empty.
    """
    problems: list[Problem] = []
    document = _in_goals(document, problems)
    task, wrong = salvage(document, TaskConfig)
    problems += wrong
    default = read_document(find_data("algorithms", "default")).data
    slots, sound = list(default), {**default, **task.algorithms}
    problems += disturbance_faults(task.disturbances, document)
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
        lacking: dict[str, Any] = {kind: "" for kind in _NAMED if not isinstance(document.data.get(kind), str)}
        task = replace(task, algorithms=sound, **lacking)
    return task


def _in_goals(document: Document, faults: list[Problem]) -> Document:
    """Drop the former fields of goals; each one is a fault that names the current spelling."""
    for old, kind in _NOW_IN_GOALS.items():
        value = document.data.get(old)
        fields = dict(value) if isinstance(value, Mapping) else {}
        if old == "goal" and "name" in fields:
            fields["at"] = fields.pop("name")
        if value is not None:
            form = yaml.safe_dump([{kind: fields}], default_flow_style=True, sort_keys=False, width=1000).strip()
            form = form if isinstance(value, Mapping) else f"[{{{kind}: …}}] with the fields of {kind!r}"
            faults.append(document.problem((old,), f"is an entry of 'goals' now: write goals: {form}"))
    return replace(document, data={name: value for name, value in document.data.items() if name not in _NOW_IN_GOALS})


def task_of_tree(tree: str) -> str | None:
    """Return the first shipped task, by name, that uses a shipped tree, or None if there is none.

    ``tree``: its name or file. A file of the same name elsewhere does not count.
    """
    wanted = Path(tree).stem
    is_file = Path(tree).name != tree or Path(tree).suffix
    if wanted not in data_names("tree") or (is_file and Path(tree).resolve() != find_data("tree", wanted).resolve()):
        return None
    for name in data_names("task"):
        if Path(str(read_document(find_data("task", name)).data.get("tree", ""))).stem == wanted:
            return name
    return None
