"""Failure codes that were merged with others: what still names an old one is told the new one."""

from __future__ import annotations

import re
from collections.abc import Iterator

from behaviours.failure import declared_failures
from bestman_bt.engine import Tree
from bestman_bt.engine.errors import Problem
from bestman_bt.engine.unwritten import problem_at

RENAMED_CODES = {
    "hand_full": "hand_not_empty",
    "not_seen": "not_found",
    "object_not_found": "not_found",
    "time_limit": "timeout",
}

_QUOTED = re.compile(r"'([^']*)'")


def renamed_codes(tree: Tree) -> Iterator[Problem]:
    """Old codes in the scripts, cases and lists of codes of a tree; own skills that declare one may keep it."""
    own = {code for kind in {type(node) for node in tree.nodes} for code in declared_failures(kind)}
    for node in tree.nodes:
        for port, text in node.attributes.items():
            for code in _codes(port, text):
                if code in RENAMED_CODES and code not in own:
                    new = RENAMED_CODES[code]
                    yield problem_at(node, port, f"no skill fails as {code!r}", f"it is called {new!r} now")


def _codes(port: str, text: object) -> list[str]:
    """What an attribute compares a code with."""
    if not isinstance(text, str):
        return []
    if port.startswith("_") or port in ("code", "if"):
        return _QUOTED.findall(text)
    if port == "error_codes_to_check":
        return text.split(";")
    return [text] if port.startswith("case_") else []
