"""XML files of py_trees (``py_trees.parsers.behaviour_tree_xml``, since 2.5), read as the equivalent nodes of this
engine.

They look like files of BehaviorTree.CPP, with other names of control nodes and decorators, in any case of letters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from bestman_bt.engine.xml.elements import Element

Change = Callable[[Element], tuple[str, dict[str, str]] | None]
"""Returns the tag and the ports here; None if a node means nothing here."""


def _with_memory(remembers: str, reactive: str) -> Change:
    def change(element: Element) -> tuple[str, dict[str, str]]:
        return (remembers if element.attributes.get("memory", "true").lower() == "true" else reactive), {}

    return change


def _parallel(element: Element) -> tuple[str, dict[str, str]] | None:
    counts = {"success_on_one": "1", "success_on_all": "-1"}
    needed = counts.get(element.attributes.get("policy", "success_on_one"))
    return None if needed is None else ("Parallel", {"success_count": needed, "failure_count": "1"})


def _timeout(element: Element) -> tuple[str, dict[str, str]] | None:
    try:
        return "Timeout", {"msec": str(round(1000 * float(element.attributes.get("duration", "5.0"))))}
    except (ValueError, OverflowError):
        return None


def _counted(tag: str, port: str, named: str) -> Change:
    return lambda element: (tag, {port: element.attributes.get(named, "")})


def _plain(tag: str) -> Change:
    return lambda element: (tag, {})


_CHANGES: Final[dict[str, tuple[tuple[str, ...], Change]]] = {
    "sequence": (("memory",), _with_memory("Sequence", "ReactiveSequence")),
    "selector": (("memory",), _with_memory("Fallback", "ReactiveFallback")),
    "fallback": (("memory",), _with_memory("Fallback", "ReactiveFallback")),
    "parallel": (("policy",), _parallel),
    "inverter": ((), _plain("Inverter")),
    "failureissuccess": ((), _plain("ForceSuccess")),
    "successisfailure": ((), _plain("ForceFailure")),
    "successisrunning": ((), _plain("KeepRunningUntilFailure")),
    "retry": (("num_failures",), _counted("RetryUntilSuccessful", "num_attempts", "num_failures")),
    "repeat": (("num_success",), _counted("Repeat", "num_cycles", "num_success")),
    "timeout": (("duration",), _timeout),
}
"""Lower-case tag → the ports that py_trees knows, and what the node is here."""
_SIGNS: Final = frozenset((
    "selector", "failureissuccess", "successisfailure", "successisrunning", "failureisrunning", "runningisfailure",
    "runningissuccess", "retry", "oneshot", "statustoblackboard", "passthrough",
))  # fmt: skip
"""Lower-case tags that BehaviorTree.CPP does not have."""


def find_py_trees_element(root: Element) -> Element | None:
    """Return the first element that only a file of py_trees has, or None."""
    return None if "BTCPP_format" in root.attributes else next(_signs(root), None)


def convert_to_own_nodes(root: Element) -> None:
    """Convert nodes and ports of a py_trees file to those of this engine, in place."""
    for child in root.children:
        if child.tag.lower() in ("import", "include"):
            child.tag = "include"
            child.attributes = {"path": child.attributes.get("src") or child.attributes.get("file") or ""}
    for element in _nodes(root):
        ports, change = _CHANGES.get(element.tag.lower(), ((), None))
        changed = None if change is None else change(element)
        if changed is not None:
            kept = {key: value for key, value in element.attributes.items() if key not in ports}
            element.tag, element.attributes = changed[0], {**kept, **changed[1]}


def _nodes(root: Element) -> Iterator[Element]:
    return (element for tree in root.children if tree.tag == "BehaviorTree" for element in tree.iter())


def _signs(root: Element) -> Iterator[Element]:
    yield from (child for child in root.children if child.tag.lower() == "import" or child.attributes.get("file"))
    for element in _nodes(root):
        tag = element.tag.lower()
        known = _CHANGES.get(tag, ((), None))[0]
        if tag in _SIGNS or (known and not element.attributes.keys().isdisjoint(known)):
            yield element
