"""Access to the goals of a task with several goals."""

from __future__ import annotations

from behaviours.skill import ErrorReporting
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Pose

FIELDS = ("object", "source", "target", "goal")


class TakeGoal(ErrorReporting, SyncAction):
    """Split one of a task's goals into object, source, target surface, and pose on it."""

    entry = In(dict, "one of the root entry goals: object, source, target, goal")
    object = Out(str, "the object", required=True)
    source = Out(str, "the surface to search first", required=True)
    target = Out(str, "the target surface", required=True)
    goal = Out(Pose, "target pose, in the map frame", required=True)

    def on_tick(self) -> int:
        """Write each field to its port."""
        entry: dict[str, object] = self.entry
        missing = [name for name in FIELDS if name not in entry]
        if missing:
            return self.explain("bad_input", f"a goal should have {', '.join(FIELDS)}; {', '.join(missing)} is missing")
        for name in FIELDS:
            self.set_output(name, entry[name])
        return self.succeed()
