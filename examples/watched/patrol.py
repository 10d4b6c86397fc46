"""A program of py_trees as it was before; the line with ``watch`` shows it on the live page and records it.

python examples/watched/patrol.py          # and, in another terminal: bestman-bt monitor
"""

from __future__ import annotations

import sys

import py_trees

from bestman_bt.monitor import watch


class DriveTo(py_trees.behaviour.Behaviour):
    """Takes three ticks."""

    def initialise(self) -> None:
        """Begin at the start."""
        self.left = 3

    def update(self) -> py_trees.common.Status:
        """One third of the way."""
        self.left -= 1
        self.feedback_message = f"{self.left} m to go"
        py_trees.blackboard.Blackboard.set("goal", self.name)
        return py_trees.common.Status.RUNNING if self.left else py_trees.common.Status.SUCCESS


def main(ticks: int = 100, period_ms: int = 200) -> None:
    """Drive from place to place."""
    places = [DriveTo("dock"), DriveTo("kitchen"), DriveTo("hall")]
    root = py_trees.composites.Sequence("patrol", memory=True, children=places)
    tree = py_trees.trees.BehaviourTree(root)
    with watch(tree):
        tree.tick_tock(period_ms=period_ms, number_of_iterations=ticks)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
