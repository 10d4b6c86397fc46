"""What one is told who begins to watch an execution."""

from __future__ import annotations

from bestman_bt.monitor.event_stream import StateSnapshot
from bestman_bt.records.events import (
    BlackboardEvent,
    PausedEvent,
    ResumedEvent,
    RobotEvent,
    RunEvent,
    ScanEvent,
    ShownEntry,
)

RUN = RunEvent("fetch", "Main", "", "", 0, "", 1, 1000.0, 20.0, "simulated")
PAUSED = PausedEvent(1.0, "asked")


def told(standing: StateSnapshot, *topics: str) -> list[str]:
    return [event.event for event in standing.events(topics)]


def test_a_pause_is_reported_while_it_lasts_and_no_longer() -> None:
    standing = StateSnapshot()
    assert told(standing) == []
    standing.take(RUN)
    standing.take(PAUSED)
    assert told(standing) == ["run", "paused"]
    standing.take(ResumedEvent(2.0))
    assert told(standing) == ["run"]
    standing.take(PAUSED)
    assert told(standing) == ["run", "paused"]


def test_each_is_told_of_the_topics_that_were_asked_for_and_of_the_newest_alone() -> None:
    standing = StateSnapshot()
    for time in (1.0, 2.0):
        standing.take(RUN)
        standing.take(RobotEvent(time, 1, (time, 0.0, 0.0), (0.0, 0.0), {}))
        standing.take(ScanEvent(time, (0.0, 0.0, 0.0), []))
        standing.take(BlackboardEvent(time, 1, {"": {"n": ShownEntry("int", str(time))}}))
    assert told(standing, "robot") == ["run", "robot"]
    assert told(standing, "scan", "blackboard") == ["run", "blackboard", "scan"]
    (_, robot) = standing.events(("robot",))
    assert isinstance(robot, RobotEvent)
    assert robot.time == 2.0
