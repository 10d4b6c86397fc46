"""Blackboards as Groot2 asks for them: MessagePack, byte for byte as BehaviorTree.CPP writes it by nlohmann::json.

Keys are sorted, reals that a float32 holds exactly are written as one, and a blackboard without entries is nil.
"""

from __future__ import annotations

import math
import numbers
import struct
from typing import Any

from bestman_bt.engine import Blackboard, Tree
from bestman_bt.monitor.groot2.errors import RequestError
from bestman_bt.records.shown_value import show_value

ROOT = "ROOT"
"""The name by which the topmost blackboard comes with that of any SubTree."""
_INTEGERS = range(-(2**63), 2**64)


def dump_blackboards(tree: Tree, names: str) -> bytes:
    """The entries of the blackboards ``names``, separated by ``;``: paths of SubTrees, or the tree's own name.

    Unknown names are left out; nil if none is left. RequestError where a SubTree is itself named ROOT.
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
    """``value`` as JSON could hold it; what it cannot as text."""
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
    """MessagePack as nlohmann::json writes it; the library's packer has one width for all reals."""
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
