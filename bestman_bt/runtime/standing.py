"""How an execution stands: what one is told who begins to watch it, or has missed something."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from bestman_bt.engine import IDLE
from bestman_bt.records.events import (
    BlackboardEvent,
    BreakpointsEvent,
    EndEvent,
    Event,
    MapEvent,
    PathEvent,
    PausedEvent,
    ResumedEvent,
    RobotEvent,
    RunEvent,
    ScanEvent,
    ShownEntry,
    StatesEvent,
    Topic,
    TreeEvent,
    topic_of,
)


@dataclass
class _TreeStanding:
    told: TreeEvent
    states: dict[int, int]
    messages: dict[int, str] = field(default_factory=dict)


class Standing:
    """Takes every event, and gives those that tell the same at once."""

    def __init__(self) -> None:
        self._run: RunEvent | None = None
        self._trees: dict[int, _TreeStanding] = {}
        self._latest: dict[str, Event] = {}
        self._blackboard: dict[str, dict[str, ShownEntry]] = {}
        self.time = 0.0
        """Of the latest event."""
        self._tick = 0

    def take(self, event: Event) -> None:
        """Keep what an event tells."""
        match event:
            case RunEvent():
                self._run = event
            case TreeEvent():
                ended = [number for number, tree in self._trees.items() if number and tree.told.under == event.under]
                for number in ended:
                    del self._trees[number]
                self._trees[event.tree] = _TreeStanding(event, {node.uid: IDLE for node in event.nodes})
            case StatesEvent():
                self.time, self._tick = event.time, event.tick
                if event.tree in self._trees:
                    self._trees[event.tree].states.update(event.changes)
                    self._trees[event.tree].messages.update(event.messages)
            case BlackboardEvent():
                self.time, self._tick = event.time, event.tick
                for scope, entries in event.entries.items():
                    self._blackboard.setdefault(scope, {}).update(entries)
            case ResumedEvent():
                self._latest.pop("paused", None)
            case MapEvent() | RobotEvent() | ScanEvent() | PathEvent():
                self._latest[event.event] = event
            case PausedEvent() | BreakpointsEvent() | EndEvent():
                self._latest[event.event] = event

    def events(self, topics: Collection[Topic]) -> Iterator[Event]:
        """The run, the trees, and how all stands of these topics; nothing before the first event."""
        if self._run is None:
            return
        yield self._run
        for tree in self._trees.values():
            yield tree.told
        if "map" in self._latest:
            yield self._latest["map"]
        if "states" in topics:
            for number, tree in self._trees.items():
                yield StatesEvent(self.time, self._tick, list(tree.states.items()), dict(tree.messages), number)
        if "blackboard" in topics:
            entries = {scope: dict(entries) for scope, entries in self._blackboard.items()}
            yield BlackboardEvent(self.time, self._tick, entries)
        for name, event in list(self._latest.items()):
            if name != "map" and topic_of(event) in (None, *topics):
                yield event
