"""How long a run drove, moved its arm, perceived and planned: simulated time of its running leaves, by family."""

from __future__ import annotations

from bestman_bt.engine import RUNNING, Node, Tree

FAMILIES = {
    "drive_s": ("navigate", "nav2", "explore", "localise"),
    "arm_s": ("move_arm", "grasp", "place", "place_in", "open", "close", "push", "run_policy"),
    "perception_s": ("perceive", "scan", "second_look", "look", "look_into", "handles", "check_held"),
    "planning_s": ("stand", "open_stand", "close_stand", "push_stand", "tidying"),
}
"""Duration → modules of ``behaviours`` whose leaves it adds up."""
_OTHER_FAMILY = {
    "PlanGrasp": "planning_s",
    "FindPlacePose": "planning_s",
    "ComputePathToPose": "planning_s",
    "ComputePathThroughPoses": "planning_s",
    "Wait": None,
}
"""Leaves that are of another family than their module."""


def duration_of(leaf: type[Node]) -> str | None:
    """The duration that a leaf's time counts to, also of a class derived from a shipped one; None: to no duration."""
    for base in leaf.__mro__:
        folder, _, rest = base.__module__.partition(".")
        if folder == "behaviours":
            module = rest.partition(".")[0]
            family = next((name for name, modules in FAMILIES.items() if module in modules), None)
            return _OTHER_FAMILY.get(base.__name__, family)
    return None


class Durations:
    """Adds up, from tick to tick, the time in which at least one leaf of a family is running, in inner trees too."""

    def __init__(self, tree: Tree) -> None:
        self._clock = tree.clock
        self._before = self._clock.now()
        self._leaves: dict[str, list[Node]] = {}
        self._running: list[str] = []
        self._seconds: dict[str, float] = {}
        self._add(tree)
        tree.subscribe_to_inner(self._add)

    @property
    def seconds(self) -> dict[str, float]:
        """Of the families that the tree has leaves of."""
        return {name: round(self._seconds[name], 3) for name in FAMILIES if name in self._seconds}

    def after_tick(self) -> None:
        """What was running since the last tick has worked for that long."""
        now = self._clock.now()
        for name in self._running:
            self._seconds[name] += now - self._before
        self._before = now
        self._running = [name for name, leaves in self._leaves.items() if any(leaf.state == RUNNING for leaf in leaves)]

    def _add(self, tree: Tree, under: Node | None = None) -> None:
        for node in tree.nodes:
            name = duration_of(type(node)) if not node.children else None
            if name is not None:
                self._leaves.setdefault(name, []).append(node)
                self._seconds.setdefault(name, 0.0)
