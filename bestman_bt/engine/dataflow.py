"""Data flow: the readers and writers of each blackboard entry of a loaded tree, through all remapping."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from bestman_bt.engine.blackboard import Slot, key_fault
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import ScriptError
from bestman_bt.engine.leaves.blackboard import names_entry
from bestman_bt.engine.scripting.parser import (
    Assignment,
    Binary,
    Comparison,
    Constant,
    Expression,
    Name,
    Ternary,
    Unary,
    parse_script,
)

_NameUse: TypeAlias = tuple[str, str, Sequence[Name | Constant]]
SCRIPT_ATTRIBUTES = (
    "_failureIf",
    "_successIf",
    "_skipIf",
    "_while",
    "_onSuccess",
    "_onFailure",
    "_onHalted",
    "_post",
)


@dataclass(frozen=True)
class EntryUse:
    """One read or write of an entry; ``key``: the local name of the entry.

    ``creates``: it makes an entry that does not exist, as all writes but ``=`` and ``+=`` of scripts do. ``is_text``: a
    script compares the entry with a text, or assigns one. ``alike``: entries that the script compares it with or
    assigns to it.
    """

    slot: Slot
    node: Node
    port: str
    key: str
    writes: bool
    creates: bool = False
    is_text: bool = False
    alike: tuple[Slot, ...] = ()


def entry_uses(tree: Tree) -> list[EntryUse]:
    """Return every use of an entry, in the order of the nodes."""
    return [use for node in tree.nodes for use in _uses_of(tree, node)]


def _uses_of(tree: Tree, node: Node) -> Iterator[EntryUse]:
    board = node.board
    ports = tree.info_of(node).ports
    for name, value in node.attributes.items():
        yield from _uses_of_attribute(tree, node, name, value)
    for name, port in ports.items():
        key = key_of(port.default, name) if port.direction != "input" and name not in node.attributes else None
        if key is not None:
            yield EntryUse(board.slot(key), node, name, key, True, creates=True)


def _script_uses(tree: Tree, node: Node, attribute: str, source: str) -> Iterator[EntryUse]:
    try:
        statements = parse_script(source)
    except ScriptError:
        return
    enums = tree.compiler.enums
    for statement in statements:
        for key, operator, alike in _names(statement):
            if key not in enums:
                slot, creates = node.board.slot(key), operator == ":="
                is_text = any(isinstance(one, Constant) and isinstance(one.value, str) for one in alike)
                names = (one.name for one in alike if isinstance(one, Name) and one.name and one.name not in enums)
                slots = tuple(node.board.slot(name) for name in names)
                yield EntryUse(slot, node, attribute, key, bool(operator), creates, is_text, slots)


def _uses_of_attribute(tree: Tree, node: Node, name: str, value: Any) -> Iterator[EntryUse]:
    board, info = node.board, tree.info_of(node)
    key, port = key_of(value, name), info.ports.get(name)
    if name in SCRIPT_ATTRIBUTES:
        yield from _script_uses(tree, node, name, str(value))
    elif key is None and names_entry(type(node), name):
        if not key_fault(str(value)):
            yield EntryUse(board.slot(str(value)), node, name, str(value), True, creates=True)
    elif key is not None and port is not None and not isinstance(node, SubTree):
        if port.direction != "output":
            yield EntryUse(board.slot(key), node, name, key, False)
        if port.direction != "input":
            yield EntryUse(board.slot(key), node, name, key, True, creates=True)
    elif key is None and port is not None and name in ("code", "if") and info.builtin:
        yield from _script_uses(tree, node, name, str(value))


def _names(expression: Expression, alike: Sequence[Name | Constant] = ()) -> Iterator[_NameUse]:
    """Yield each key in an expression, the operator that writes it (empty: it is read), and ``alike``: names and
    constants whose values are of its type, itself among them.
    """
    match expression:
        case Name():
            yield expression.name, "", alike
        case Assignment():
            alike = (*alike, *_values(expression))
            if expression.name and expression.operator not in (":=", "="):
                yield expression.name, "", alike
            yield from _names(expression.value, alike)
            if expression.name:
                yield expression.name, expression.operator, alike
        case Ternary():
            yield from _names(expression.condition)
            for result in (expression.then, expression.otherwise):
                yield from _names(result, alike)
        case Comparison() | Binary(operator="+"):
            operands = _operands(expression)
            beside = [value for operand in operands for value in _values(operand)]
            for operand in operands:
                yield from _names(operand, beside if isinstance(expression, Comparison) else (*alike, *beside))
        case _:
            for operand in _operands(expression):
                yield from _names(operand)


def _values(expression: Expression) -> Sequence[Name | Constant]:
    """Return names and constants of the same type as the result of an expression, as far as they are known."""
    match expression:
        case Name() | Constant():
            return (expression,)
        case Assignment():
            return Name(expression.name), *_values(expression.value)
        case Ternary():
            return *_values(expression.then), *_values(expression.otherwise)
        case Binary(operator="+"):
            return *_values(expression.left), *_values(expression.right)
        case Binary(operator=".."):
            return (Constant(""),)
    return ()


def _operands(expression: Expression) -> Sequence[Expression]:
    match expression:
        case Unary():
            return (expression.operand,)
        case Binary():
            return expression.left, expression.right
        case Comparison():
            return expression.operands
        case Ternary():
            return expression.condition, expression.then, expression.otherwise
    return ()


def render_ports(tree: Tree) -> str:
    """Return the remapping of each SubTree and the readers and writers of each entry, as text."""
    readers: dict[int, set[str]] = defaultdict(set)
    writers: dict[int, set[str]] = defaultdict(set)
    own: dict[str, set[str]] = defaultdict(set)  # of a board, by the prefix of the paths of its entries
    for use in entry_uses(tree):
        (writers if use.writes else readers)[id(use.slot)].add(_place(use))
        own[use.slot.path.removesuffix(use.slot.key)].add(use.slot.key)
    lines: list[str] = []
    for path, board in tree.blackboards.items():
        title = tree.subtree_ids[path]
        lines.append(f"{title} ({path})" if path else title)
        outer = "" if "/" not in path else path.rpartition("/")[0]
        for inner, outside in board.remapping.items():
            where = tree.subtree_ids.get(outer, "")
            lines.append(f"  {inner} = {{{outside}}} of {where}")
        if board.autoremap:
            lines.append("  every other key = the same key outside (_autoremap)")
        for key in sorted({*own[board.local_path("")], *board.keys()}):
            slot = board.local_slot(key)
            kind = board.entry(key).type if slot.exists else "any"
            value = "" if slot.value is None else f" = {slot.value!r}"
            lines.append(f"  {key}: {kind}{value}")
            lines.append(f"    written by {', '.join(sorted(writers[id(slot)])) or 'no node of the tree'}")
            lines.append(f"    read by    {', '.join(sorted(readers[id(slot)])) or 'no node of the tree'}")
    return "\n".join(lines) + "\n"


def _place(use: EntryUse) -> str:
    renamed = "" if use.key == use.slot.key else f" as {use.key}"
    return f"{use.node.path}.{use.port}{renamed}"
