"""Entries that a tree reads although nothing has written them: misspelt keys, and forgotten ports of SubTrees."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import CodeType, FunctionType

from bestman_bt.engine import controls, decorators
from bestman_bt.engine.blackboard import Slot
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.dataflow import EntryUse, entry_uses
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.leaves.blackboard import WasEntryUpdated
from bestman_bt.engine.leaves.native import PyTreesBehaviour
from bestman_bt.engine.spelling import closest

_IN_ORDER = (controls.Sequence, controls.Fallback)
_ONCE = (
    *(*_IN_ORDER, decorators.SubTree, decorators.Inverter, decorators.ForceSuccess, decorators.ForceFailure),
    *(decorators.Timeout, decorators.Delay, decorators.RunOnce),
)
"""Nodes that tick each child once to its end, so that an earlier child has ended when the next one starts."""


MOST_HINTS = 50
"""Largest number of suggestions per tree: each compares a name with all others."""
_OURS = ("bestman_bt.", "behaviours.", "py_trees.", "builtins")
"""Modules whose nodes write only through their ports."""


@dataclass(frozen=True)
class UnwrittenRead:
    """An entry that has no value when it is read.

    ``node``, ``port``, ``key``: its outermost use, which is the SubTree that passes it in, or else the reader.
    ``fails``: whether reading it ends the tree, because the reader has no default. ``later``: the line of a write that
    happens too late, 0 if the line is unknown; None: no node of the tree writes it. ``not_given``: the node is a
    SubTree of another file that reads a port which was not given.
    """

    node: Node
    port: str
    key: str
    fails: bool
    later: int | None
    suggestion: str
    not_given: bool = False

    def problem(self, severity: str, why: str = "") -> TreeProblem:
        """Return the read as a problem; ``why`` replaces the default reason."""
        if self.not_given:
            words = f"it is not given, and the tree '{self.node.type_id}' reads it"
            return problem_at(self.node, self.port, words, self.suggestion, severity)
        if not why and self.later is None:
            why = "which nothing in the tree writes"
        elif not why:
            why = "which is written only later" + (f", in line {self.later}" if self.later else "")
        return problem_at(self.node, self.port, f"reads '{{{self.key}}}', {why}", self.suggestion, severity)


def problem_at(node: Node, port: str, message: str, suggestion: str, severity: str = "error") -> TreeProblem:
    """Return a problem of a node's port, with file and line."""
    file = "" if node.place is None else node.place.file
    element = "SubTree" if isinstance(node, decorators.SubTree) else node.type_id
    return TreeProblem(file, node.line, element, port, message, suggestion, severity)


def unwritten_reads(tree: Tree, given: Iterable[str] = ()) -> Iterator[UnwrittenRead]:
    """Yield each entry that is read before it has a value; ``given``: root entries set before the run.

    Writes that code does not declare in ports (``may_write_undeclared``) are not visible here. A port whose default is
    an empty text accepts an entry without a value and does not count.
    """
    uses, subtrees, hints = entry_uses(tree), SubTrees(tree), 0
    fatal = {id(use.slot) for use in uses if not use.writes and _fails(tree, use)}
    known: dict[int, list[Slot]] = {}
    set_before = {id(tree.blackboard.slot(key)) for key in given}
    writers: dict[int, list[Node]] = {}
    for use in uses:
        if use.writes:
            writers.setdefault(id(use.slot), []).append(use.node)
    reported: set[tuple[int, int]] = set()
    for use in uses:
        written_by = writers.get(id(use.slot), [])
        if use.writes or id(use.slot) in set_before or use.slot.value is not None or _empty_will_do(tree, use):
            continue
        if tree.shared is not None and use.slot is tree.blackboard.slot(use.slot.key):
            continue  # what native behaviours write is known when they have written it
        if written_by and not (_fails(tree, use) and all(_ended_before(use.node, writer) for writer in written_by)):
            continue
        node, port, key = subtrees.named_at(use)
        outer = None if written_by else subtrees.of_another_file(node)
        if outer is not None:
            node, port = outer, key
        if (id(node), id(use.slot)) not in reported:
            reported.add((id(node), id(use.slot)))
            later = min(writer.line for writer in written_by) if written_by else None
            hint = ""
            if not written_by and hints < MOST_HINTS:
                hints += 1
                board = known.setdefault(id(node.board), [s for s in node.board.slots() if id(s) in writers])
                hint = _hint(node, key, use.slot, writers, board) if outer is None else _meant(subtrees, outer, key)
            yield UnwrittenRead(node, port, key, id(use.slot) in fatal, later, hint, outer is not None)


class SubTrees:
    """The SubTrees of a tree by path, and the entries used in each; built in one pass over its nodes."""

    def __init__(self, tree: Tree) -> None:
        self._by_path = {one.subtree_path: one for one in tree.nodes if isinstance(one, decorators.SubTree)}
        self._named: dict[str, dict[str, None]] = {path: {} for path in self._by_path}
        self._used: dict[str, dict[str, None]] = {path: {} for path in self._by_path}
        self._unseen: set[str] = set()
        for node in tree.nodes:
            around = list(self._around(node))
            keys = [key for port, value in node.attributes.items() if (key := key_of(value, port)) is not None]
            if around and may_write_undeclared(node):
                self._unseen.update(around)
            for path in around:
                self._named[path].update(dict.fromkeys(keys))
        for use in entry_uses(tree):
            for path in self._around(use.node):
                self._used[path][use.key] = None

    def _around(self, node: Node) -> Iterator[str]:
        """Yield the paths of the SubTrees that contain a node, innermost first."""
        place = node.place
        while place is not None and place.path:
            yield place.path
            place = self._by_path[place.path].place

    def used_in(self, subtree: decorators.SubTree) -> list[str]:
        """Return the keys of the entries that nodes inside a SubTree's tree read or write."""
        return list(self._used[subtree.subtree_path])

    def unread_ports(self, subtree: decorators.SubTree) -> list[str]:
        """Return the attributes of a SubTree that nothing inside its tree reads or writes."""
        path = subtree.subtree_path
        if path in self._unseen:
            return []
        named = {*self._used[path], *self._named[path], "name", "ID"}
        return [port for port in subtree.attributes if port[0] != "_" and port not in named]

    def of_another_file(self, node: Node) -> decorators.SubTree | None:
        """Return the SubTree of another file that lacks an entry read by a node inside it."""
        place = node.place
        while place is not None and place.path:
            outer = self._by_path[place.path]
            if outer.place is not None and outer.place.file != place.file:
                return outer
            if not place.board.autoremap:
                break
            place = outer.place
        return None

    def named_at(self, use: EntryUse) -> tuple[Node, str, str]:
        """Return node, port and key of an entry's outermost use: the SubTree that passes it in, else its user."""
        return _named_at(self._by_path, use)


def _meant(subtrees: SubTrees, subtree: decorators.SubTree, key: str) -> str:
    """Return words that suggest the SubTree attribute meant by ``key``, or how to pass it."""
    hint = closest(key, subtrees.unread_ports(subtree))
    return f"did you mean '{hint}'?" if hint else f'give {key}="…"'


def entries_of(tree: Tree) -> tuple[dict[str, bool], list[str]]:
    """Return the inputs and outputs of a tree as a SubTree.

    Inputs are root entries that only other code writes, each with whether an empty one is an error; outputs are those
    that the tree writes.
    """
    uses = [use for use in entry_uses(tree) if tree.blackboard.slot(use.slot.key) is use.slot]
    written = dict.fromkeys(use.slot.key for use in uses if use.writes)
    taken: dict[str, bool] = {}
    for use in uses:
        if use.slot.key not in written:
            taken[use.slot.key] = taken.get(use.slot.key, False) or _fails(tree, use)
    return taken, list(written)


def named_at(tree: Tree, use: EntryUse) -> tuple[Node, str, str]:
    """Return node, port and key of the outermost use of one entry; for many entries, use ``SubTrees``."""
    return _named_at({node.subtree_path: node for node in tree.nodes if isinstance(node, decorators.SubTree)}, use)


def _named_at(subtrees: Mapping[str, decorators.SubTree], use: EntryUse) -> tuple[Node, str, str]:
    node, port, key = use.node, use.port, use.key
    place = node.place
    while place is not None and place.path:
        subtree, board = subtrees[place.path], place.board
        if key in board.remapping or (key in subtree.attributes and not board.autoremap):
            node, port, key = subtree, key, board.remapping.get(key, key)
        elif not board.autoremap or key[0] in "_@":
            break
        place = subtree.place
    return node, port, key


def may_write_undeclared(node: Node) -> bool:
    """Return whether a node's code accesses the blackboard directly, and so may write undeclared entries."""
    if isinstance(node, PyTreesBehaviour):
        below = node.behaviour.iterate()
        return any(one.blackboards or not type(one).__module__.startswith("py_trees.") for one in below)
    own = [cls for cls in type(node).__mro__ if not cls.__module__.startswith(_OURS)]
    functions = [value for cls in own for value in vars(cls).values() if isinstance(value, FunctionType)]
    return any(_names(function.__code__) & {"board", "blackboard"} for function in functions)


def _names(code: CodeType) -> set[str]:
    inner = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*map(_names, inner))


def _fails(tree: Tree, use: EntryUse) -> bool:
    """Return whether reading an empty entry here is an error: of ports that must have a value, and of scripts."""
    port = tree.info_of(use.node).ports.get(use.port)
    is_needed = port is None or port.strict or use.port == "code"
    return is_needed and not isinstance(use.node, WasEntryUpdated)


def _empty_will_do(tree: Tree, use: EntryUse) -> bool:
    port = tree.info_of(use.node).ports.get(use.port)
    return port is not None and not port.strict and port.default == ""


def _ended_before(reader: Node, writer: Node) -> bool:
    """Return whether the reader has ended permanently before the writer is ticked for the first time."""
    routes = _route(reader), _route(writer)
    shared = [a for a, b in zip(*routes, strict=False) if a is b]
    if len(shared) in map(len, routes) or not all(type(node) in _ONCE for node in shared):
        return False
    parent, first, second = shared[-1], routes[0][len(shared)], routes[1][len(shared)]
    below = parent.nodes_below()
    return type(parent) in _IN_ORDER and below.index(first) < below.index(second)


def _route(node: Node) -> list[Node]:
    """Return the nodes from the root to this one."""
    route = [node]
    while isinstance(route[-1].parent, Node):
        route.append(route[-1].parent)
    return route[::-1]


def _hint(node: Node, key: str, slot: Slot, written: dict[int, list[Node]], known: list[Slot]) -> str:
    """Return a hint about the missing entry. ``known``: the written slots of the node's board."""
    board = node.board
    outer = board.parent
    if outer is not None and key not in board.remapping and id(outer.slot(key)) in written:
        return f"the enclosing tree has '{key}'; map it with {key}=\"{{{key}}}\""
    hint = closest(key, [other.key for other in known if other is not slot])
    return f"did you mean '{{{hint}}}'?" if hint else ""
