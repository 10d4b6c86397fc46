"""What a task with several goals asks for, taken apart."""

from __future__ import annotations

from typing import ClassVar

from py_trees.ports import PortInformation

from behaviours.skill import Explained
from bestman_bt.engine import SyncAction
from bestman_bt.messages import Pose

FIELDS = ("object", "source", "target", "goal")


class TakeGoal(Explained, SyncAction):
    """Take one of a task's goals apart: which object, from where, to which surface, and where on it."""

    INPUT_PORTS: ClassVar = {
        "entry": PortInformation(dict, description="one of the root entry goals: object, source, target, goal")
    }
    OUTPUT_PORTS: ClassVar = {
        "object": PortInformation(str, description="the object"),
        "source": PortInformation(str, description="the surface to look for it first"),
        "target": PortInformation(str, description="the surface where it shall go"),
        "goal": PortInformation(Pose, description="where it shall stand, in the map frame"),
    }

    def on_tick(self) -> int:
        """Writes each field to its port."""
        entry: dict[str, object] = self.get_input("entry")
        missing = [name for name in FIELDS if name not in entry]
        if missing:
            return self.explain("bad_input", f"a goal should have {', '.join(FIELDS)}; {', '.join(missing)} is missing")
        for name in FIELDS:
            self.set_output(name, entry[name])
        return self.succeed()
