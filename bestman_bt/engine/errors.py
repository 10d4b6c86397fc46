"""The engine's exceptions: a node that fails to execute, a tree that fails to load, a blackboard misuse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class EngineError(Exception):
    """Base of everything that the engine raises on purpose."""


class NodeError(EngineError):
    """A node could not execute; names the node by its full path and its type."""

    def __init__(self, message: str, *, node: str = "", node_type: str = "") -> None:
        self.node = node
        self.node_type = node_type
        self.reason = message
        where = f"node '{node}' [{node_type}]: " if node or node_type else ""
        super().__init__(where + message)


class BlackboardError(EngineError):
    """An entry is missing, or a value does not fit the type that the entry is locked to."""


class ScriptError(EngineError):
    """A script does not parse, or one of its operations is not permitted."""


class ConversionError(EngineError, ValueError):
    """A text or value cannot become the type that a port declares."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a tree file.

    ``severity`` is ``"error"`` or ``"warning"``; only errors stop a tree from loading. ``line`` is 0 where no
    line is known (trees built in Python).
    """

    file: str
    line: int
    node: str
    field: str
    message: str
    suggestion: str = ""
    severity: str = "error"

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        node = f" <{self.node}>" if self.node else ""
        field = f" '{self.field}'" if self.field else ""
        hint = f" ({self.suggestion})" if self.suggestion else ""
        kind = "" if self.severity == "error" else f" {self.severity}:"
        return f"{place}:{kind}{node}{field}: {self.message}{hint}"


class TreeLoadError(EngineError):
    """A tree does not load; ``problems`` holds everything that is wrong with it, in document order."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))
