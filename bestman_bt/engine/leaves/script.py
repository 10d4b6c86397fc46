"""Leaves that run the script language: Script, ScriptCondition, and TestNode, which replaces a real leaf."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bestman_bt.engine.core.ports import In, key_of
from bestman_bt.engine.core.tick_hooks import Tick
from bestman_bt.engine.errors import ScriptError
from bestman_bt.engine.leaves.base import Condition, StatefulAction, SyncAction
from bestman_bt.engine.scripting.compiler import ScriptCompiler
from bestman_bt.engine.scripting.parser import parse_script
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, STATUS_NAMES, SUCCESS


@dataclass(frozen=True)
class TestNodeConfig:
    """The behaviour of a TestNode.

    Attributes:
        return_status: its result, unless ``return_status_script`` or ``complete`` decides.
        return_status_script: a script whose value is the result; it knows the names of the statuses.
        success_script: runs if the result is SUCCESS.
        failure_script: runs if the result is FAILURE.
        post_script: runs after every result.
        async_delay: seconds of the tree's clock for which it is RUNNING first.
        complete: a function that returns the result.

    Raises:
        ScriptError: a script has a syntax error; names the field.
    """

    __test__ = False

    return_status: int = SUCCESS
    return_status_script: str = ""
    success_script: str = ""
    failure_script: str = ""
    post_script: str = ""
    async_delay: float = 0.0
    complete: Callable[[], int] | None = None

    def __post_init__(self) -> None:
        for name in ("return_status_script", "success_script", "failure_script", "post_script"):
            try:
                if source := getattr(self, name):
                    parse_script(source)
            except ScriptError as error:
                raise ScriptError(f"{name}: {error}") from None


class TestNode(StatefulAction):
    """A leaf that behaves as its ``TestNodeConfig`` specifies."""

    __test__ = False
    config: TestNodeConfig = TestNodeConfig()

    def on_load(self) -> None:
        """Compile the scripts."""
        compiler = self.owner.compiler
        names = {name: value for value, name in enumerate(STATUS_NAMES)}
        statuses = ScriptCompiler({**compiler.enums, **names})
        config = self.config
        self._result = self._compiled(statuses, config.return_status_script)
        self._on_success = self._compiled(compiler, config.success_script)
        self._on_failure = self._compiled(compiler, config.failure_script)
        self._post = self._compiled(compiler, config.post_script)
        self._end = 0.0

    def _compiled(self, compiler: ScriptCompiler, source: str) -> Callable[[], Any] | None:
        return compiler.compile(source, self.board) if source else None

    def on_start(self) -> int:
        """Start the delay; without one, complete immediately."""
        if self.config.async_delay <= 0:
            return self._complete()
        self._end = self.clock.now() + self.config.async_delay
        return RUNNING

    def on_running(self) -> int:
        """Complete when the delay is over."""
        return self._complete() if self.clock.now() >= self._end else RUNNING

    def _complete(self) -> int:
        status = self._decide()
        script = {SUCCESS: self._on_success, FAILURE: self._on_failure}.get(status)
        if script is not None:
            script()
        if self._post is not None:
            self._post()
        return status

    def _decide(self) -> int:
        found: Any = self.config.return_status
        if self.config.complete is not None:
            found = self.config.complete()
        elif self._result is not None:
            found = self._result()
            found = STATUS_NAMES.index(found) if found in STATUS_NAMES else found
        for status in (RUNNING, SUCCESS, FAILURE, SKIPPED):
            if found == status:
                return status
        raise self.error(f"its result is {found!r}; RUNNING, SUCCESS, FAILURE or SKIPPED are accepted")


class Script(SyncAction):
    """Runs ``code`` and succeeds."""

    code = In(str, "Piece of code that can be parsed")

    def on_load(self) -> None:
        """Compile the code, unless it comes from the blackboard."""
        self.source: str | None = None
        self.script: Callable[[], Any] | None = None
        if key_of(self.attributes["code"], "code") is None:
            self.source = self.code
            self.script = _nothing if not self.source else self.owner.compiler.compile(self.source, self.board)

    def bound(self, core: Tick) -> Tick:
        """Return the compiled code as the tick if it is a literal."""
        script = self.script
        if script is None or core != self.on_tick:
            return core

        def run() -> int:
            script()
            return SUCCESS

        return run

    def on_tick(self) -> int:
        """Run the code; code from the blackboard is compiled when it changes."""
        source = self.code
        if source != self.source or self.script is None:
            self.script = self.owner.compiler.compile(source, self.board)
            self.source = source
        self.script()
        return SUCCESS


def _nothing() -> None:
    """Do nothing: an empty script."""


class ScriptCondition(Condition):
    """Returns SUCCESS if ``code`` is true, else FAILURE."""

    code = In(str, "Piece of code that can be parsed. Must return false or true")

    def on_load(self) -> None:
        """Compile the code, unless it comes from the blackboard."""
        self.source: str | None = None
        self.holds: Callable[[], bool] | None = None
        if key_of(self.attributes["code"], "code") is None:
            self.source = self.code
            self.holds = self.owner.compiler.compile_condition(self.source, self.board)

    def bound(self, core: Tick) -> Tick:
        """Return the compiled code as the tick if it is a literal."""
        holds = self.holds
        if holds is None or core != self.on_tick:
            return core
        return lambda: SUCCESS if holds() else FAILURE

    def on_tick(self) -> int:
        """Evaluate the code; code from the blackboard is compiled when it changes."""
        source = self.code
        if source != self.source or self.holds is None:
            self.holds = self.owner.compiler.compile_condition(source, self.board)
            self.source = source
        return SUCCESS if self.holds() else FAILURE
