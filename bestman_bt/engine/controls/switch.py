"""The choice of a child: by a blackboard value (Switch2 to Switch6), or by a person (ManualSelector)."""

from __future__ import annotations

import sys
from typing import ClassVar, TextIO

from py_trees import composites
from py_trees.ports import PortInformation

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.conversion import number_from_text
from bestman_bt.engine.core.ports import In
from bestman_bt.engine.scripting.operations import EPSILON
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS

_RESULTS = {"s": SUCCESS, "f": FAILURE, "r": RUNNING}


class ManualSelector(Control, composites.Selector):
    """Asks on the terminal which child to tick, or which status to return, and waits for the answer."""

    repeat_last_selection = In(bool, "If true, execute the child that was selected last time again", default=False)
    QUESTIONS: ClassVar[TextIO | None] = None
    """Stream to which the question is written; None: standard error."""
    ANSWERS: ClassVar[TextIO | None] = None
    """Stream from which answers are read, one per line; None: standard input."""

    def on_load(self) -> None:
        """Initialise without a previous choice."""
        self.chosen = -1
        self.running = -1

    def halt(self) -> None:
        """Halt the running child."""
        self.running = -1
        super().halt()

    def on_tick(self) -> int:
        """Choose a child, unless the last choice is repeated or still running, and tick it."""
        children = self.nodes_below()
        repeat = self.chosen >= 0 and self.repeat_last_selection
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
                raise self.error("cannot ask: the input has ended, or is not a terminal")
            answer = line.strip().lower()
            if answer in _RESULTS:
                return answer
            if answer.isdigit() and 1 <= int(answer) <= len(names):
                return str(int(answer) - 1)


class Switch(Control, composites.Selector):
    """Ticks the child whose ``case_N`` equals ``variable``, else the last; a change halts the running child.

    Values are compared as text, then as numbers; names of enum values count as their numbers.
    """

    CASES: ClassVar[int] = 0
    CHECKED_AT_TICK = True

    def on_load(self) -> None:
        """Initialise without a selected case."""
        self.current = -1

    def halt(self) -> None:
        """Forget the case."""
        self.current = -1
        super().halt()

    def on_tick(self) -> int:
        """Choose the case and tick it."""
        children = self.nodes_below()
        if len(children) != self.CASES + 1:
            raise self.error(f"it must have {self.CASES + 1} children, a child for each case and one more")
        chosen = self._choose()
        if self.current not in (-1, chosen):
            self.halt_child(children[self.current])
        status = children[chosen].execute_tick()
        if status == SKIPPED:
            self.current = -1
        elif status == RUNNING:
            self.current = chosen
        else:
            self.reset_children()
            self.current = -1
        return status

    def _choose(self) -> int:
        variable = self.get_input("variable")
        if variable is not None:
            for index in range(self.CASES):
                case = self.get_input(f"case_{index + 1}")
                if case is not None and self._same(variable, case):
                    return index
        return self.CASES

    def _same(self, left: str, right: str) -> bool:
        if left == right:
            return True
        a, b = self._number(left), self._number(right)
        return a is not None and b is not None and abs(a - b) <= EPSILON

    def _number(self, text: str) -> float | None:
        enums = self.owner.registry.enums
        if text in enums:
            return float(enums[text])
        number = number_from_text(text)
        return None if isinstance(number, str) else float(number)


def _ports(cases: int) -> dict[str, PortInformation]:
    ports = {"variable": PortInformation(str, False, "the value that selects the child")}
    ports.update({f"case_{n}": PortInformation(str, False, f"the value of child {n}") for n in range(1, cases + 1)})
    return ports


class Switch2(Switch):
    """A Switch with 2 cases and a default: 3 children."""

    CASES, MIN_CHILDREN, MAX_CHILDREN, INPUT_PORTS = 2, 3, 3, _ports(2)


class Switch3(Switch):
    """A Switch with 3 cases and a default: 4 children."""

    CASES, MIN_CHILDREN, MAX_CHILDREN, INPUT_PORTS = 3, 4, 4, _ports(3)


class Switch4(Switch):
    """A Switch with 4 cases and a default: 5 children."""

    CASES, MIN_CHILDREN, MAX_CHILDREN, INPUT_PORTS = 4, 5, 5, _ports(4)


class Switch5(Switch):
    """A Switch with 5 cases and a default: 6 children."""

    CASES, MIN_CHILDREN, MAX_CHILDREN, INPUT_PORTS = 5, 6, 6, _ports(5)


class Switch6(Switch):
    """A Switch with 6 cases and a default: 7 children."""

    CASES, MIN_CHILDREN, MAX_CHILDREN, INPUT_PORTS = 6, 7, 7, _ports(6)
