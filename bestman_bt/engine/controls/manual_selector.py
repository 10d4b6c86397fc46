"""ManualSelector: a person at the terminal chooses which child is ticked."""

from __future__ import annotations

import sys
from typing import ClassVar, TextIO

from py_trees import composites
from py_trees.ports import PortInformation

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.status import FAILURE, RUNNING, SUCCESS

_RESULTS = {"s": SUCCESS, "f": FAILURE, "r": RUNNING}


class ManualSelector(Control, composites.Selector):
    """Asks on the terminal which child to tick, or which status to return; waits for the answer."""

    INPUT_PORTS = {
        "repeat_last_selection": PortInformation(
            bool, False, "If true, execute again the same child that was selected the last time", False
        )
    }
    QUESTIONS: ClassVar[TextIO | None] = None
    """Where the question is written; standard error where None."""
    ANSWERS: ClassVar[TextIO | None] = None
    """Where the answer is read, a line each; standard input where None."""

    def on_load(self) -> None:
        """Begin without a choice."""
        self.chosen = -1
        self.running = -1

    def halt(self) -> None:
        """Halt the child that runs."""
        self.running = -1
        super().halt()

    def on_tick(self) -> int:
        """Ask, unless the last choice is to be repeated or its child still runs, and tick the child."""
        children = self.nodes_below()
        repeat = self.chosen >= 0 and bool(self.get_input("repeat_last_selection"))
        self.set_state(RUNNING)
        if not repeat:
            answer = self._ask([child.name for child in children])
            if answer in _RESULTS:
                return self._settle(_RESULTS[answer])
            self.chosen = int(answer)
        if self.running not in (-1, self.chosen):
            self.halt_child(children[self.running])
        status = children[self.chosen].execute_tick()
        self.running = self.chosen if status == RUNNING else -1
        return self._settle(status)

    def _settle(self, status: int) -> int:
        if status != RUNNING:
            self.reset_children()
            self.running = -1
        return status

    def _ask(self, names: list[str]) -> str:
        questions = self.QUESTIONS or sys.stderr
        answers = self.ANSWERS or sys.stdin
        choices = ", ".join(f"{index + 1} {name}" for index, name in enumerate(names))
        while True:
            questions.write(f"{self.path}: which child ({choices}), or s success, f failure, r running? ")
            questions.flush()
            line = answers.readline()
            if not line:
                raise self.error("there is no terminal to ask (end of input)")
            answer = line.strip().lower()
            if answer in _RESULTS:
                return answer
            if answer.isdigit() and 1 <= int(answer) <= len(names):
                return str(int(answer) - 1)
