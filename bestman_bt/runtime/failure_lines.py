"""One line of the log for each failure of a leaf: which node, with what code, and why in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from behaviours.failure import NodeFailure, declared_failures
from bestman_bt.engine import FAILURE, Tree
from bestman_bt.engine.errors import Problem
from bestman_bt.engine.unwritten import problem_at
from bestman_bt.records.described_tree import category_of

# Failure codes that were merged with others: what still names an old one is told the new one.


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


class FailureLines:
    """Puts together what the tree and what the skills tell; what conditions deny is an answer, and no failure.

    ``told``: what skills told, oldest first; it grows while the run goes on.
    """

    def __init__(self, told: Sequence[NodeFailure] = ()) -> None:
        self._told = told
        self._read = len(told)

    def of(self, tree: Tree, uids: Iterable[int]) -> list[NodeFailure]:
        """The lines of leaves that have just failed."""
        new = {failure.node: failure for failure in self._told[self._read :]}
        self._read = len(self._told)
        lines = []
        for uid in uids:
            node = tree.nodes[uid - 1]
            failure = new.get(node.path)
            if failure is not None:
                lines.append(failure)
            else:
                lines.append(NodeFailure(node.path, "", node.feedback_message or f"{node.type_id} failed", node.where))
        return lines


def failure_codes(tree: Tree) -> frozenset[int]:
    """The entries of ``StateChanges.codes`` that say that an action failed."""
    return frozenset(
        node.uid * 8 + FAILURE for node in tree.nodes if not node.children and category_of(node) == "action"
    )
