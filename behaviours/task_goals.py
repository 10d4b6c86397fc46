"""What a task with several goals asks for, taken apart."""

from __future__ import annotations

from behaviours.skill import Explained
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Pose

FIELDS = ("object", "source", "target", "goal")


class TakeGoal(Explained, SyncAction):
    """Take one of a task's goals apart: which object, from where, to which surface, and where on it."""

    entry = In(dict, "one of the root entry goals: object, source, target, goal")
    object = Out(str, "the object", required=True)
    source = Out(str, "the surface to look for it first", required=True)
    target = Out(str, "the surface where it shall go", required=True)
    goal = Out(Pose, "where it shall stand, in the map frame", required=True)

    def on_tick(self) -> int:
        """Writes each field to its port."""
        entry: dict[str, object] = self.entry
        missing = [name for name in FIELDS if name not in entry]
        if missing:
            return self.explain("bad_input", f"a goal should have {', '.join(FIELDS)}; {', '.join(missing)} is missing")
        for name in FIELDS:
            self.set_output(name, entry[name])
        return self.succeed()
