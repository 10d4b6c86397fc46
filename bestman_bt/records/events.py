"""The events of an execution, on the control channel and in run folders.

An event is one JSON object per line; ``event`` names its kind. Times are seconds of the robot's clock since the run's
start, poses and points are in the map frame, states as in ``bestman_bt.engine.status``, nodes are given by uid: 1
is the root, in pre-order. ``tree`` 0 is the main tree; others are trees ticked by one of its leaves.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, TypeAdapter, ValidationError

from bestman_bt.errors import Error
from bestman_bt.messages import MotionObstacle

VERSION = 1
MAIN_TREE = 0

Topic = Literal["states", "blackboard", "robot", "scan", "images", "log"]
TOPICS: tuple[Topic, ...] = ("states", "blackboard", "robot", "scan", "images", "log")
"""The topics of subscriptions; events without a topic are sent to every subscriber."""
Level = Literal["debug", "info", "warning", "error"]
Category = Literal["action", "condition", "control", "decorator", "subtree"]

Count = Annotated[int, Field(ge=0, lt=1 << 53)]
"""As large as browsers count."""
Started = Annotated[float, Field(ge=0.0, le=1e11)]
"""Seconds since the epoch; up to a year of four digits."""
TickRate = Annotated[float, Field(ge=0.0, le=1e6)]


class EventError(Error, ValueError):
    """Raised if a line is not a valid event."""


@dataclass(frozen=True)
class RunEvent:
    """The first event, which describes the run. ``started``: seconds since the epoch; ``tick_rate``: hertz.

    ``folder``: of the run, absolute; empty if nothing is recorded. ``source``: an external executor, such as
    ``groot2://127.0.0.1:1667``, which can only be watched; a restart is a new run.
    """

    task: str
    tree: str
    scene: str
    robot: str
    seed: int
    folder: str
    pid: int
    started: Started
    tick_rate: TickRate
    clock: Literal["simulated", "real"]
    version: int = VERSION
    source: str = ""
    event: Literal["run"] = "run"


@dataclass(frozen=True)
class DescribedNode:
    """A node. ``type``: as in XML, for a SubTree its tree's ID; ``parent``: uid of the parent, None for the root.

    ``path``: unique in its tree; ``ports``: port or attribute → text; ``scope``: path of its SubTree. ``where``: its
    name with file and line; empty without a file. ``placeholder``: it has no code here.
    """

    uid: int
    parent: int | None
    name: str
    type: str
    category: Category
    path: str
    ports: dict[str, str]
    scope: str
    where: str = ""
    placeholder: bool = False

    @property
    def is_leaf(self) -> bool:
        """Whether it is an action or a condition."""
        return self.category in ("action", "condition")

    @property
    def named(self) -> str:
        """The name with file and line, or the path without a file."""
        return self.where or self.path


@dataclass(frozen=True)
class TreeEvent:
    """A tree that is ticked from now on, parents before children; ``under``: uid of the leaf of the main tree that
    ticks it.
    """

    nodes: list[DescribedNode]
    xml: str
    id: str
    tree: int = MAIN_TREE
    under: int | None = None
    event: Literal["tree"] = "tree"


@dataclass(frozen=True)
class StatesEvent:
    """Changes of one tick or halt, in order, as (uid, new state), and feedback of nodes, by uid.

    An event that lists all nodes is the full state. In run folders the changes of the main tree are in the ``.btlog``.
    """

    time: float
    tick: Count
    changes: list[tuple[Count, Count]]
    messages: dict[int, str] = field(default_factory=dict)
    tree: int = MAIN_TREE
    event: Literal["states"] = "states"


@dataclass(frozen=True)
class ShownEntry:
    """A blackboard entry: its type and value as text, and the value itself if it is plain and short.

    ``type`` is empty for a removed entry.
    """

    type: str
    text: str
    value: Any = None


@dataclass(frozen=True)
class BlackboardEvent:
    """The entries that were written, by scope (path of the SubTree, empty for the main tree) and key."""

    time: float
    tick: Count
    entries: dict[str, dict[str, ShownEntry]]
    event: Literal["blackboard"] = "blackboard"


@dataclass(frozen=True)
class RobotEvent:
    """The believed base pose (x, y, yaw), its standard deviations (metres, radians), joints, and the held object.

    ``diagnostics``: part → fault. ``speed``: the operator's scale of the robot's speed.
    """

    time: float
    tick: Count
    base: tuple[float, float, float]
    believed_std: tuple[float, float]
    joints: dict[str, float]
    velocities: dict[str, float] | None = None
    efforts: dict[str, float] | None = None
    held: str | None = None
    diagnostics: dict[str, str] | None = None
    speed: float = 1.0
    event: Literal["robot"] = "robot"


@dataclass(frozen=True)
class ScanEvent:
    """The lidar's hits, thinned, and the believed base pose at the scan."""

    time: float
    base: tuple[float, float, float]
    points: list[tuple[float, float]]
    event: Literal["scan"] = "scan"


@dataclass(frozen=True)
class MapPiece:
    """The outline of a named piece of furniture, counter-clockwise."""

    name: str
    polygon: list[tuple[float, float]]


@dataclass(frozen=True)
class MapEvent:
    """The map: ``walls`` as segments x1, y1, x2, y2.

    ``width`` × ``height`` cells of ``resolution`` metres, from the corner ``origin`` with the smallest x and y.
    ``png``: base64 of a grid with these cells, dark where occupied, its first row at the greatest y; may be empty.
    """

    resolution: float
    origin: tuple[float, float]
    width: int
    height: int
    png: str
    furniture: list[MapPiece]
    walls: list[tuple[float, float, float, float]]
    event: Literal["map"] = "map"


@dataclass(frozen=True)
class PathEvent:
    """The path that the base follows from now on; empty for none."""

    time: float
    planned: list[tuple[float, float]]
    event: Literal["path"] = "path"


@dataclass(frozen=True)
class ImageEvent:
    """A picture that a skill took: ``jpeg`` in base64, or, in run folders, the ``file`` relative to the folder.

    ``node``: the leaf whose failure the picture precedes; empty for others.
    """

    time: float
    camera: str
    width: int
    height: int
    jpeg: str = ""
    file: str = ""
    node: str = ""
    event: Literal["image"] = "image"


@dataclass(frozen=True)
class LogEvent:
    """A line of the log; for a failure with the node's path, its code and its message.

    ``where``: the node's name with file and line; empty without a file. ``obstacle``: the cause of a failed motion.
    """

    time: float
    level: Level
    message: str
    node: str = ""
    code: str = ""
    logger: str = "tree"
    where: str = ""
    obstacle: MotionObstacle | None = None
    event: Literal["log"] = "log"


@dataclass(frozen=True)
class PausedEvent:
    """The execution waits: on request, before or after ``node`` (path), or for confirmation of a motion.

    That motion is described in ``words``; ``swept``: outlines of its swept area, in the map frame.
    """

    time: float
    reason: Literal["asked", "breakpoint", "confirm"]
    node: str | None = None
    when: Literal["before", "after"] | None = None
    words: str = ""
    swept: list[list[tuple[float, float]]] = field(default_factory=list)
    event: Literal["paused"] = "paused"


@dataclass(frozen=True)
class ResumedEvent:
    """The execution continues."""

    time: float
    event: Literal["resumed"] = "resumed"


@dataclass(frozen=True)
class BreakpointsEvent:
    """All breakpoints, after one was set, cleared or used up."""

    breakpoints: list[dict[str, Any]]
    event: Literal["breakpoints"] = "breakpoints"


@dataclass(frozen=True)
class EndEvent:
    """The last event: ``outcome`` as in ``result.json``; a run without it was interrupted."""

    time: float
    outcome: str
    tree_status: str
    why: str = ""
    event: Literal["end"] = "end"


@dataclass(frozen=True)
class DroppedEvent:
    """Events were lost because their reader was too slow; the full state follows."""

    count: int
    event: Literal["dropped"] = "dropped"


Event: TypeAlias = (
    RunEvent
    | TreeEvent
    | StatesEvent
    | BlackboardEvent
    | RobotEvent
    | ScanEvent
    | MapEvent
    | PathEvent
    | ImageEvent
    | LogEvent
    | PausedEvent
    | ResumedEvent
    | BreakpointsEvent
    | EndEvent
    | DroppedEvent
)

_TOPIC_OF: dict[str, Topic] = {
    "states": "states",
    "blackboard": "blackboard",
    "robot": "robot",
    "path": "robot",
    "scan": "scan",
    "image": "images",
    "log": "log",
}
_EVENTS: TypeAdapter[Event] = TypeAdapter(Annotated[Event, Field(discriminator="event")])


def topic_of(event: Event) -> Topic | None:
    """Return the topic of an event, or None for events sent to all subscribers."""
    return _TOPIC_OF.get(event.event)


def to_line(event: Event) -> bytes:
    """Return an event as one line of JSON."""
    return _EVENTS.dump_json(event) + b"\n"


def from_line(line: bytes | str) -> Event:
    """Return the event of a line.

    Raises:
        EventError: it is not an event, or lacks a field.
    """
    return _checked(lambda: _EVENTS.validate_json(line), "no event")


def from_log_line(line: bytes | str) -> LogEvent:
    """Return the event of a line of ``log.jsonl``, where ``event`` is the message; raises the errors of
    ``from_line``.
    """

    def read() -> Event:
        document = json.loads(line)
        return _EVENTS.validate_python({**document, "message": document["event"], "event": "log"})

    try:
        event = _checked(read, "no line of a log")
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise EventError(f"no line of a log: {error!r}") from error
    assert isinstance(event, LogEvent)
    return event


def _checked(read: Callable[[], Event], what: str) -> Event:
    try:
        return read()
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise EventError(f"{what}: {where}: {first['msg']}" if where else f"{what}: {first['msg']}") from error
