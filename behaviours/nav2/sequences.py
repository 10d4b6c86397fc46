"""Nav2's control nodes without a robot: NonblockingSequence, PersistentSequence, SingleTrigger, …"""

from __future__ import annotations

from typing import Any, ClassVar

from behaviours.nav2.pacing import WatchesGoals
from behaviours.nav2.ports import without_meaning
from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS, Control, Decorator, InOut


class NonblockingSequence(Control):
    """Tick all children, including those after a running one; SUCCESS if all succeed in one tick."""

    def on_tick(self) -> int:
        """Tick each child."""
        self.set_state(RUNNING)
        done = True
        for child in self.nodes_below():
            status = child.execute_tick()
            if status == FAILURE:
                self.reset_children()
                return FAILURE
            done = done and status != RUNNING
        if not done:
            return RUNNING
        self.reset_children()
        return SUCCESS


class PersistentSequence(Control):
    """A sequence that keeps the index of its next child in an entry, which survives a halt."""

    current_child_idx = InOut(int, "index of the next child, from 0", default=0)

    def on_tick(self) -> int:
        """Continue with that child. Raises NodeError for an index out of range."""
        children, index = self.nodes_below(), self.current_child_idx or 0
        if index < 0:
            raise self.error(f"current_child_idx is {index}; 0 to {len(children)} are accepted")
        self.set_state(RUNNING)
        while index < len(children):
            status = children[index].execute_tick()
            if status == RUNNING:
                return RUNNING
            index = 0 if status == FAILURE else index + 1
            self.current_child_idx = index
            if status == FAILURE:
                break
        else:
            status = SUCCESS
            self.current_child_idx = 0
        self.reset_children()
        return status


class PauseResumeController(Control):
    """Tick the first child; pausing by a service is not supported: ``bestman-bt pause`` pauses the whole run."""

    MAX_CHILDREN: ClassVar = 4
    INPUT_PORTS: ClassVar = without_meaning("pause_service_name", "resume_service_name")

    def on_tick(self) -> int:
        """Tick the first child."""
        return self.nodes_below()[0].execute_tick()


class SingleTrigger(Decorator):
    """Tick the child until it ends once, then FAILURE, until this node is halted or its parent has ended.

    As in Nav2 it restarts below a parent that resets finished children; use ``RunOnce`` there.
    """

    def on_load(self) -> None:
        """Reset the trigger."""
        self._ended = False

    def on_tick(self) -> int:
        """Tick the child, or fail."""
        if self._s <= IDLE:
            self._ended = False
        self.set_state(RUNNING)
        if self._ended:
            return FAILURE
        status = self.child.execute_tick()
        self._ended = status in (SUCCESS, FAILURE)
        return status


class GoalUpdatedController(WatchesGoals, Decorator):
    """Tick the child at the start, and when ``goal`` or ``goals`` change; RUNNING in between."""

    def on_load(self) -> None:
        """Reset the goals."""
        self._goals: tuple[Any, Any] = (None, None)

    def on_tick(self) -> int:
        """Tick the child if it is running or due."""
        goals = self.goal, self.goals
        due = self._s <= IDLE or goals != self._goals
        self._goals = goals
        self.set_state(RUNNING)
        if not (due or self.child._s == RUNNING):
            return RUNNING
        return self.child.execute_tick()
