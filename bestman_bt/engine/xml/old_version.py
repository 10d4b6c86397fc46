"""Detection of tree files of BehaviorTree.CPP 3, and of names that changed in version 4."""

from __future__ import annotations

from typing import Final

from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.xml.elements import Element

RENAMED: Final = {
    "SequenceStar": "SequenceWithMemory",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
    "SubTreePlus": "SubTree",
}
SIGNS: Final = frozenset((*RENAMED, *(f"BlackboardCheck{kind}" for kind in ("Int", "Double", "String", "Bool"))))
_SIGN_ATTRIBUTES: Final = ("__shared_blackboard", "__autoremap")
_SIGNS_OF_PARALLEL: Final = ("success_threshold", "failure_threshold")


def old_version(root: Element, file: str) -> TreeProblem | None:
    """Return a problem if a file is of version 3, or None."""
    version = root.attributes.get("BTCPP_format")
    if version == "4":
        return None
    sign = "BTCPP_format" if version == "3" else ""
    line = root.line
    trees = [tree for tree in root.children if tree.tag == "BehaviorTree"] if not sign else []
    for element in (element for tree in trees for element in tree.iter()):
        names = {element.tag, element.attributes.get("ID", ""), *element.attributes}
        parallel = _SIGNS_OF_PARALLEL if "Parallel" in names else ()
        found = [name for name in (*SIGNS, *_SIGN_ATTRIBUTES, *parallel) if name in names]
        if found:
            sign, line = found[0], element.line
            break
    if not sign:
        return None
    message = f"the file is in the format of BehaviorTree.CPP 3 ('{sign}')"
    return TreeProblem(file, line, "", "", message, f"convert it with: bestman-bt convert {file}")
