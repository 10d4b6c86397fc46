"""The engine's exceptions: a node that fails to execute, a tree that fails to load, a blackboard misuse."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from bestman_bt.errors import Error, InputError


class EngineError(Error):
    """Base of all errors that the engine raises on purpose."""


class NodeError(EngineError):
    """A node could not execute; ``node``: its full path, ``where``: its name in the message.

    ``backtrace``: the ancestors of the node, root first, and the node itself, each with type and place.
    """

    def __init__(
        self, message: str, *, node: str = "", node_type: str = "", where: str = "", backtrace: Sequence[str] = ()
    ) -> None:
        self.backtrace = tuple(backtrace)
        self.node = node
        self.node_type = node_type
        self.reason = message
        named = f"node {where or repr(node)} [{node_type}]: " if node or node_type else ""
        super().__init__(named + message)


class BlackboardError(EngineError):
    """Raised if an entry is missing, or a value does not fit the locked type of its entry."""


class ScriptError(EngineError):
    """Raised if a script has a syntax error, or uses an operation that is not permitted."""


class ConversionError(EngineError, ValueError):
    """Raised if a text or value cannot be converted to the type of a port."""


@dataclass(frozen=True)
class TreeProblem:
    """One fault of a tree file.

    ``field``: the port or attribute concerned. ``severity``: ``"error"``, ``"latent"`` (the tree loads, as in
    BehaviorTree.CPP, but fails once the node is ticked or its tree is used) or ``"warning"``. ``line``: 0 if unknown
    (trees built in Python). ``missing``: whether a node, port or tree is unknown here but may exist in another
    BehaviorTree.CPP process.
    """

    file: str
    line: int
    node: str
    field: str
    message: str
    suggestion: str = ""
    severity: str = "error"
    missing: bool = False

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        severity = f"{_SEVERITIES[self.severity]}: " if self.severity != "error" else ""
        parts = [f"<{self.node}>"] if self.node else []
        if self.field:
            is_port = self.field[0].islower() and self.field not in _NO_PORTS
            parts.append(f"port '{self.field}'" if is_port else f"'{self.field}'")
        hint = f" ({self.suggestion})" if self.suggestion else ""
        return f"{place}: {severity}{' '.join(parts)}{': ' if parts else ''}{self.message}{hint}"


_SEVERITIES = {"latent": "error once it is ticked", "warning": "warning"}
MOST_LINES: Final = 8
"""Largest number of line numbers in the message of one cause."""
_NO_PORTS = frozenset(("name", "path", "ros_pkg", "main_tree_to_execute"))


class TreeLoadError(EngineError, InputError):
    """Raised if a tree cannot be loaded; ``problems`` lists every fault, in document order."""

    def __init__(self, problems: Sequence[TreeProblem]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(in_lines(self.problems)))


def in_lines(problems: Iterable[TreeProblem]) -> list[str]:
    """Return the problems as text, one line per cause and file, with the first place and the others."""
    by_cause: dict[TreeProblem, list[TreeProblem]] = {}
    for problem in problems:
        by_cause.setdefault(replace(problem, line=0), []).append(problem)
    return [_in_a_line(together) for together in by_cause.values()]


def _in_a_line(together: list[TreeProblem]) -> str:
    lines = sorted({problem.line for problem in together})
    if len(lines) < 2:
        return str(together[0])
    shown = ", ".join(map(str, lines[1:MOST_LINES]))
    rest = f" and {len(lines) - MOST_LINES} more" if len(lines) > MOST_LINES else ""
    return f"{together[0]} [{len(lines)} times: also in line{'s' if len(lines) > 2 else ''} {shown}{rest}]"
