"""Groot2's wire protocol, version 2, as BehaviorTree.CPP 4.10 speaks it (``loggers/groot2_protocol.h``).

A request: 6 bytes ``<BBI`` (protocol, letter of the kind, id that the client chose), then at most one part. A reply:
the same 6 bytes and 16 of the tree's UUID, then at most one part. What fails is answered by ``error`` and words.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from bestman_bt.monitor.groot2.errors import RequestError

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
    """One request; ``kind`` is the letter as it came, known or not; ``content`` None where there is no second part."""

    kind: int
    identifier: int
    content: bytes | None

    @classmethod
    def parse(cls, parts: Sequence[bytes]) -> Request:
        """Read the parts of a message; RequestError where they are no request."""
        if not parts or len(parts[0]) != _HEADER.size:
            raise RequestError("wrong request header")
        _, kind, identifier = _HEADER.unpack(parts[0])
        return cls(kind, identifier, parts[1] if len(parts) == 2 else None)

    def needed(self) -> bytes:
        """The second part of a request that has to have one."""
        if self.content is None:
            raise RequestError("must be 2 parts message")
        return self.content

    def header(self) -> bytes:
        """The six bytes of this request."""
        return _HEADER.pack(PROTOCOL, self.kind, self.identifier)


def reply(request: Request, tree_uuid: bytes, content: bytes | None) -> list[bytes]:
    """The parts of an answer; ``tree_uuid``: 16 bytes that tell one loaded tree from another."""
    parts = [request.header() + tree_uuid]
    return parts if content is None else [*parts, content]


def error_reply(words: str) -> list[bytes]:
    """The parts of an answer to what cannot be done."""
    return [b"error", words.encode()]


def breakpoint_message(identifier: int, uid: int) -> list[bytes]:
    """What is published when a tick reaches a hook on node ``uid``."""
    return [Request(RequestKind.BREAKPOINT_REACHED, identifier, None).header(), str(uid).encode()]
