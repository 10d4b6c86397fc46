"""Whether a file is a recording, before a viewer is asked to open it.

Rerun's own reader refuses what a killed run leaves, which its viewer opens; so the frames of the format are followed:
12 bytes of ``RRF2``, version and options, then messages of u64 kind, u64 length and that many bytes, little endian;
kind 0 is the end, with a footer behind it.
"""

from __future__ import annotations

import struct
from pathlib import Path

from bestman_bt.visualization.errors import RecordingError

_HEAD = struct.Struct("<4s4s4s")
_MESSAGE = struct.Struct("<QQ")
_END, _LAST_KIND = 0, 3


def check_recording(path: Path) -> None:
    """RecordingError where ``path`` is no recording, or is damaged, or holds nothing.

    One that ends within a message, because the run was killed, is a recording.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
        if head[:4] != b"RRF2" or len(head) < _HEAD.size:
            raise RecordingError(f"is no Rerun recording: it begins with {head[:4]!r} instead of b'RRF2'")
        messages = 0
        while len(frame := file.read(_MESSAGE.size)) == _MESSAGE.size:
            kind, length = _MESSAGE.unpack(frame)
            at = file.tell()
            if kind == _END:
                break
            if kind > _LAST_KIND:
                raise RecordingError(f"is a damaged Rerun recording: at byte {at} is a message of kind {kind}")
            messages += 1
            file.seek(min(length, size - at), 1)
    if messages == 0:
        raise RecordingError("is an empty Rerun recording")
