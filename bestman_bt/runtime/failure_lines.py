"""One log line for each failure of a leaf: node, code and reason."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from behaviours.failure import NodeFailure, declared_failures
from bestman_bt.engine import FAILURE, Tree
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.status import state_code
from bestman_bt.engine.unwritten import problem_at
from bestman_bt.records.described_tree import category_of

RENAMED_CODES = {
    "hand_full": "hand_not_empty",
    "not_seen": "not_found",
    "object_not_found": "not_found",
    "time_limit": "timeout",
}
"""Former failure code → the code that replaced it, which messages suggest."""

_QUOTED = re.compile(r"'([^']*)'")


def renamed_codes(tree: Tree) -> Iterator[TreeProblem]:
    """Yield renamed error codes in scripts, cases and code lists of a tree; codes of the user's own skills are
    exempt.
    """
    own = {code for kind in {type(node) for node in tree.nodes} for code in declared_failures(kind)}
    for node in tree.nodes:
        for port, text in node.attributes.items():
            for code in _codes(port, text):
                if code in RENAMED_CODES and code not in own:
                    new = RENAMED_CODES[code]
                    yield problem_at(node, port, f"no skill fails with {code!r}", f"use {new!r}")


def _codes(port: str, text: object) -> list[str]:
    """Return the codes with which an attribute compares."""
    if not isinstance(text, str):
        return []
    if port.startswith("_") or port in ("code", "if"):
        return _QUOTED.findall(text)
    if port == "error_codes_to_check":
        return text.split(";")
    return [text] if port.startswith("case_") else []


class FailureLines:
    """Combines failures of the tree and of the skills; a condition that is false is not a failure.

    ``failures``: those reported by skills, oldest first; it grows during the run.
    """

    def __init__(self, failures: Sequence[NodeFailure] = ()) -> None:
        self._failures = failures
        self._read = len(failures)

    def of(self, tree: Tree, uids: Iterable[int]) -> list[NodeFailure]:
        """Return the failures of leaves that have just failed, by uid."""
        new = {failure.node: failure for failure in self._failures[self._read :]}
        self._read = len(self._failures)
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
    """Return the entries of ``StateChanges.codes`` that mark the failure of an action."""
    return frozenset(
        state_code(node.uid, FAILURE) for node in tree.nodes if not node.children and category_of(node) == "action"
    )
