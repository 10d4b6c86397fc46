"""Run by tests in a process of its own: a live BehaviorTree.CPP publisher over a tree that standard input ticks.

Arguments: XML file, port. A line ``tick`` ticks once; the status is printed, one line each. The process ends with its
standard input. A process of its own: a tick that a breakpoint holds up keeps the interpreter's lock.
"""

from __future__ import annotations

import sys
from pathlib import Path

import behaviortreepy as cpp

WORK_TICKS = 2


def tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    factory = cpp.BehaviorTreeFactory()
    left = WORK_TICKS

    def start(node: object) -> object:
        nonlocal left
        left = WORK_TICKS
        return cpp.NodeStatus.RUNNING

    def run(node: object) -> object:
        nonlocal left
        left -= 1
        return cpp.NodeStatus.RUNNING if left else cpp.NodeStatus.SUCCESS

    factory.register_simple_stateful_action("Work", start, run)
    factory.register_behavior_tree_from_text(Path(sys.argv[1]).read_text())
    tree = factory.create_tree("Main")
    publisher = cpp.Groot2Publisher(tree, int(sys.argv[2]))
    publisher.set_enabled(True)
    tell("ready")
    for _ in sys.stdin:
        tell(str(tree.tick_exactly_once()).rpartition(".")[2])


if __name__ == "__main__":
    main()
