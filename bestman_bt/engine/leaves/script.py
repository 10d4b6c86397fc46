"""Script and ScriptCondition: the script language as leaves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.ports import PortInformation

from bestman_bt.engine.around_tick import Tick
from bestman_bt.engine.leaves.base import Condition, SyncAction
from bestman_bt.engine.ports import key_of
from bestman_bt.engine.status import FAILURE, SUCCESS


class Script(SyncAction):
    """Runs ``code`` and succeeds."""

    INPUT_PORTS = {"code": PortInformation(str, True, "Piece of code that can be parsed")}

    def on_load(self) -> None:
        """Compile the code, unless it comes from the blackboard."""
        self.source: str | None = None
        self.script: Callable[[], Any] | None = None
        if key_of(self.attributes["code"], "code") is None:
            self.source = self.get_input("code")
            self.script = _nothing if not self.source else self.owner.compiler.compile(self.source, self.board)

    def bound(self, core: Tick) -> Tick:
        """Run the compiled code directly where it is a literal."""
        script = self.script
        if script is None or core != self.on_tick:
            return core

        def run() -> int:
            script()
            return SUCCESS

        return run

    def on_tick(self) -> int:
        """Run the code; code from the blackboard is compiled when it changes."""
        source = self.get_input("code")
        if source != self.source or self.script is None:
            self.script = self.owner.compiler.compile(source, self.board)
            self.source = source
        self.script()
        return SUCCESS


def _nothing() -> None:
    """Do what a script without any text does."""


class ScriptCondition(Condition):
    """SUCCESS where ``code`` is true, else FAILURE."""

    INPUT_PORTS = {"code": PortInformation(str, True, "Piece of code that can be parsed. Must return false or true")}

    def on_load(self) -> None:
        """Compile the code, unless it comes from the blackboard."""
        self.source: str | None = None
        self.holds: Callable[[], bool] | None = None
        if key_of(self.attributes["code"], "code") is None:
            self.source = self.get_input("code")
            self.holds = self.owner.compiler.compile_condition(self.source, self.board)

    def bound(self, core: Tick) -> Tick:
        """Run the compiled code directly where it is a literal."""
        holds = self.holds
        if holds is None or core != self.on_tick:
            return core
        return lambda: SUCCESS if holds() else FAILURE

    def on_tick(self) -> int:
        """Evaluate the code; code from the blackboard is compiled when it changes."""
        source = self.get_input("code")
        if source != self.source or self.holds is None:
            self.holds = self.owner.compiler.compile_condition(source, self.board)
            self.source = source
        return SUCCESS if self.holds() else FAILURE
