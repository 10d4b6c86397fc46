"""Which entries were written since one last looked."""

from __future__ import annotations

from bestman_bt.engine import AlwaysSuccess, ManualClock, build_tree
from bestman_bt.runtime.telemetry import BlackboardChanges


def test_entries_are_reported_once_when_they_are_written_and_when_they_are_removed() -> None:
    clock = ManualClock()
    tree = build_tree(AlwaysSuccess(), clock=clock)
    changes = BlackboardChanges(tree)

    def told() -> list[tuple[str, bool, object]]:
        return [(entry.key, entry.exists, entry.value) for entry in changes.collect()]

    tree.blackboard.set("n", 1)
    assert told() == [("n", True, 1)]
    assert told() == []
    tree.blackboard.unset("n")
    assert told() == [("n", False, None)]
    assert told() == []
    tree.blackboard.set("n", 2)
    assert told() == [("n", True, 2)]
    clock.advance(0.05)
    tree.tick_exactly_once()
    tree.blackboard.unset("n")
    tree.blackboard.set("n", 3)
    assert told() == [("n", True, 3)], "its count is again what it was"
