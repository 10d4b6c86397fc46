"""Tasks: which tree, scene and robot; the goal; what counts as success and what the robot may touch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.data import data_names, find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.quantity import Frequency, PositiveAngle, PositiveLength, PositiveTime, Time
from bestman_bt.registry import suggestion

T = TypeVar("T")
_TEN_DEGREES = math.radians(10.0)
TickRate = Annotated[Frequency, Field(le=1000)]  # physics takes steps of about a millisecond


@dataclass(frozen=True)
class GoalConfig:
    """``object``, to be sought on ``source``, shall stand at the world's goal ``name`` on ``surface``.

    Surfaces are named as in the map: ``counter`` or ``counter/top``.
    """

    name: str
    object: str
    source: str
    surface: str


@dataclass(frozen=True)
class TolerancesConfig:
    """How near a success has to come: metres, radians (``yaw`` None: any), seconds of rest before it is judged."""

    position: PositiveLength = 0.02
    tilt: PositiveAngle = _TEN_DEGREES
    yaw: PositiveAngle | None = None
    rest_time: Time = 1.0


@dataclass(frozen=True)
class TaskConfig:
    """A task.

    ``predicate``: the name of the success predicate. ``allowed_contacts``: pairs that may touch, each an object, a
    piece of furniture, ``fingers``, ``robot`` or one of its links. ``max_penetration``: metres. ``time_limit``:
    simulated seconds. ``tick_rate``: hertz, 1000 at most.
    ``algorithms``: slot → ``algorithm: NAME`` and its parameters, laid over the shipped default.
    """

    tree: str
    scene: str
    robot: str
    goal: GoalConfig | None = None
    predicate: str | None = None
    tolerances: TolerancesConfig = field(default_factory=TolerancesConfig)
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    max_penetration: PositiveLength = 0.002
    time_limit: PositiveTime = 300.0
    tick_rate: TickRate = 20.0
    algorithms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    plugins: tuple[str, ...] = ()
    description: str = ""

    def algorithm(self, slot: str) -> tuple[str, dict[str, Any]]:
        """Name and parameters of the algorithm in a slot; KeyError names the slots that there are."""
        if slot not in self.algorithms:
            raise KeyError(f"no algorithm is chosen for {slot!r}; there are {', '.join(self.algorithms) or 'none'}")
        parameters = dict(self.algorithms[slot])
        return str(parameters.pop("algorithm")), parameters


def task_document(name_or_path: str | Path) -> Document:
    """The document of a task with the default algorithms below it; raises ConfigurationError."""
    return with_default_algorithms(read_document(find_data("task", name_or_path)))


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


def check_task(document: Document) -> TaskConfig:
    """A task from its document; raises ConfigurationError."""
    task = check(document, TaskConfig)
    slots = list(read_document(find_data("algorithms", "default")).data)
    problems = []
    for slot, parameters in task.algorithms.items():
        if slot not in slots:
            problems.append(document.problem(("algorithms", slot), f"unknown slot; {suggestion(slot, slots)}"))
        elif not isinstance(parameters.get("algorithm"), str):
            message = "'algorithm' is missing: the name of the algorithm"
            problems.append(document.problem(("algorithms", slot), message))
    if problems:
        raise ConfigurationError(problems)
    return task


def task_of_tree(tree: str) -> str | None:
    """The shipped task that names a tree, the first in the order of names; None if there is none."""
    wanted = Path(tree).stem
    for name in data_names("task"):
        if Path(str(read_document(find_data("task", name)).data.get("tree", ""))).stem == wanted:
            return name
    return None


def algorithm_parameters(slot: str, parameters: Mapping[str, Any], dataclass_type: type[T]) -> T:
    """Check an algorithm's parameters against its dataclass; ConfigurationError names ``algorithms.<slot>``."""
    return check(Document(dict(parameters), {(): (f"algorithms.{slot}", None)}), dataclass_type)
