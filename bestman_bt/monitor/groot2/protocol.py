"""Groot2's wire protocol, version 2, as in BehaviorTree.CPP 4.10 (``loggers/groot2_protocol.h``).

A request: 6 bytes ``<BBI`` (protocol, letter of the kind, id chosen by the client), then at most one part. A reply: the
same 6 bytes and the 16 bytes of the tree's UUID, then at most one part. For a failure, the reply is ``error`` and a
text.
"""

from __future__ import annotations

import math
import numbers
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from bestman_bt.engine import Blackboard, Tree
from bestman_bt.errors import Error
from bestman_bt.extras import install_command
from bestman_bt.records.shown_value import show_value


class Groot2Error(Error):
    """The publisher cannot serve: the extra is missing, the port is in use, or the tree has too many nodes."""


class RequestError(Error):
    """A request cannot be answered; the client receives the message."""


def import_zmq() -> Any:
    """Return the ``zmq`` module. Raises Groot2Error if ZeroMQ or MessagePack is not installed."""
    try:
        import msgpack  # noqa: F401 - used by the callers that ask for zmq
        import zmq
    except ImportError as error:
        raise Groot2Error(f"Groot2 needs the extra groot2: {install_command('groot2')}") from error
    return zmq


# Blackboards as Groot2 asks for them: MessagePack, byte for byte as BehaviorTree.CPP writes it by nlohmann::json.
# Keys are sorted, reals that a float32 holds exactly are written as one, and a blackboard without entries is nil.


ROOT = "ROOT"
"""The name of the topmost blackboard in an answer with other blackboards."""
_INTEGERS = range(-(2**63), 2**64)


def dump_blackboards(tree: Tree, names: str) -> bytes:
    """Return the entries of the blackboards ``names``, separated by ``;``: paths of SubTrees, or the tree's name.

    Unknown names are omitted; nil if none remains. Raises RequestError if a SubTree is itself named ROOT.
    """
    boards = {path or tree.tree_id: board for path, board in tree.blackboards.items()}
    document: dict[str, Any] = {}
    for name in names.split(";"):
        board = boards.get(name)
        if board is None:
            continue
        below = board.root is not board
        if name == ROOT and (below or ROOT in document):
            raise RequestError(
                f"blackboard dump request uses reserved name [{ROOT}] together with an external root blackboard export"
            )
        document[name] = _entries(board)
        if below:
            document[ROOT] = _entries(board.root)
    return _packed(document or None)


def _entries(board: Blackboard) -> dict[str, Any] | None:
    return {slot.key: _shown(slot.value) for slot in board.slots() if slot.exists} or None


def _shown(value: Any) -> Any:
    """Return ``value`` as JSON can hold it, or as text."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, numbers.Integral):
        return int(value) if int(value) in _INTEGERS else str(value)
    if isinstance(value, numbers.Real):
        return float(value)
    if isinstance(value, (list, tuple)) and all(isinstance(item, (bool, str, numbers.Real)) for item in value):
        return [_shown(item) for item in value]
    return show_value(value).text


def _packed(value: Any) -> bytes:
    """Pack as MessagePack like nlohmann::json; the library's packer has one width for all reals."""
    import msgpack

    doubles, singles = msgpack.Packer(), msgpack.Packer(use_single_float=True)

    def packed(value: Any) -> bytes:
        if isinstance(value, dict):
            entries = (doubles.pack(key) + packed(value[key]) for key in sorted(value, key=str.encode))
            return bytes(doubles.pack_map_header(len(value)) + b"".join(entries))
        if isinstance(value, list):
            return bytes(doubles.pack_array_header(len(value)) + b"".join(map(packed, value)))
        single = isinstance(value, float) and _fits_single(value)
        return bytes((singles if single else doubles).pack(value))

    return packed(value)


def _fits_single(value: float) -> bool:
    try:
        return bool(struct.unpack("<f", struct.pack("<f", value))[0] == value) and math.isfinite(value)
    except OverflowError:
        return False


PROTOCOL = 2
DEFAULT_PORT = 1667
_HEADER = struct.Struct("<BBI")


class RequestKind(IntEnum):
    """The kinds of messages, by their letters."""

    FULL_TREE = ord("T")
    STATUS = ord("S")
    BLACKBOARD = ord("B")
    INSERT_HOOK = ord("I")
    REMOVE_HOOK = ord("R")
    REMOVE_ALL_HOOKS = ord("A")
    DISABLE_ALL_HOOKS = ord("X")
    DUMP_HOOKS = ord("D")
    UNLOCK_BREAKPOINT = ord("U")
    BREAKPOINT_REACHED = ord("N")  # the only one that goes from the tree to Groot2
    TOGGLE_RECORDING = ord("r")
    TRANSITIONS = ord("t")


@dataclass(frozen=True)
class Request:
    """One request. ``kind``: the letter as received, known or not. ``content``: None if there is no second part."""

    kind: int
    identifier: int
    content: bytes | None

    @classmethod
    def parse(cls, parts: Sequence[bytes]) -> Request:
        """Parse a message. Raises RequestError if it is not a request."""
        if not parts or len(parts[0]) != _HEADER.size:
            raise RequestError("wrong request header")
        _, kind, identifier = _HEADER.unpack(parts[0])
        return cls(kind, identifier, parts[1] if len(parts) == 2 else None)

    def needed(self) -> bytes:
        """Return the second part of a request that has to have one."""
        if self.content is None:
            raise RequestError("must be 2 parts message")
        return self.content

    def header(self) -> bytes:
        """Return the six bytes of this request."""
        return _HEADER.pack(PROTOCOL, self.kind, self.identifier)


def reply(request: Request, tree_uuid: bytes, content: bytes | None) -> list[bytes]:
    """Return the parts of an answer. ``tree_uuid``: 16 bytes that identify the loaded tree."""
    parts = [request.header() + tree_uuid]
    return parts if content is None else [*parts, content]


def error_reply(words: str) -> list[bytes]:
    """Return the parts of an error answer."""
    return [b"error", words.encode()]


def breakpoint_message(identifier: int, uid: int) -> list[bytes]:
    """Return the message that is published when a tick reaches a hook on node ``uid``."""
    return [Request(RequestKind.BREAKPOINT_REACHED, identifier, None).header(), str(uid).encode()]
