"""A recording that is damaged is refused with its file and line; only one that was cut at its end is played."""

from __future__ import annotations

import base64
import gzip
import json
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import pytest

from hal.replay.tape import TAPE_NAME, ReplayError, read_tape

HEADER = {"robot": "x", "start": 0.0, "time_step": 0.01, "parts": {"arm": {"kind": "Arm", "description": {}}}}
COUNT = 2000


def reading(number: int) -> dict[str, Any]:
    return {"t": number * 0.1, "read": "positions", "part": "arm", "value": [number, number**2 % 977]}


def text_of(header: Any = HEADER, **lines: str) -> bytes:
    """A tape; ``line_100="…"`` is what stands there instead."""
    texts = [json.dumps(header), *(json.dumps(reading(number)) for number in range(COUNT))]
    for name, text in lines.items():
        texts[int(name.removeprefix("line_")) - 1] = text
    return "".join(f"{text}\n" for text in texts).encode()


def refusal(folder: Path, data: bytes) -> str:
    (folder / TAPE_NAME).write_bytes(data)
    with pytest.raises(ReplayError) as error:
        read_tape(folder)
    assert TAPE_NAME in str(error.value)
    return str(error.value)


def test_a_whole_one_is_read(tmp_path: Path) -> None:
    (tmp_path / TAPE_NAME).write_bytes(gzip.compress(text_of()))
    tape = read_tape(tmp_path)
    assert len(tape.readings["arm", "positions"].times) == COUNT
    assert not tape.cut


@pytest.mark.slow
def test_what_unfolds_to_more_than_its_size_explains_is_not_read(tmp_path: Path) -> None:
    whole = text_of() + b'{"t": 300.0, "part": "arm", "read": "positions", "value": "' + bytes(70 << 20) + b'"}\n'
    assert "decompresses to more" in refusal(tmp_path, gzip.compress(whole))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [[10_000_000], [1 << 31, 1 << 31], [-1]])
def test_an_array_that_is_packed_small_takes_no_more_memory_than_it_may(tmp_path: Path, shape: list[int]) -> None:
    packed = base64.b64encode(zlib.compress(bytes(80_000_000), 9)).decode()
    header = {**HEADER, "parts": {"arm": {"kind": "Arm", "description": {}}}}
    header["parts"]["arm"]["description"]["limits"] = {"array": packed, "dtype": "f8", "shape": shape}
    tracemalloc.start()
    refusal(tmp_path, gzip.compress(text_of(header)))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 20 << 20


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("garbage", "line 100 is not JSON"),
        ('{"t": 9.8, "par', "line 100 is not JSON"),
        ("[1]", "line 100 is malformed: TypeError"),
        ("7", "line 100 is malformed: TypeError"),
        ('{"t": 9.8}', "line 100 is malformed: KeyError: 'part'"),
        ('{"t": 9.8, "part": "arm"}', "line 100 is malformed: KeyError"),
        ('{"t": 9.8, "part": "arm", "read": "positions"}', "line 100 is malformed: KeyError: 'value'"),
        ('{"t": 9.8, "part": "leg", "read": "positions", "value": 1}', "the robot has no part 'leg'"),
        ('{"t": null, "part": "arm", "read": "positions", "value": 1}', "t is None; a finite number is possible"),
        ('{"t": NaN, "part": "arm", "read": "positions", "value": 1}', "t is nan; a finite number is possible"),
        ('{"t": 9.8, "part": "arm", "command": "move_to", "arguments": {"array": "?", "dtype": "f8"}}', "line 100"),
        ('{"t": 9.8, "ended": 7, "status": null, "why": null}', "line 100 is malformed: KeyError: 7"),
        ('{"t": 1.0, "part": "arm", "read": "positions", "value": 1}', "line 100 is of 1.0000 s, after one of 9.7000"),
    ],
)
def test_a_line_that_is_none_is_named(tmp_path: Path, line: str, words: str) -> None:
    assert words in refusal(tmp_path, gzip.compress(text_of(line_100=line)))


@pytest.mark.parametrize(
    "header",
    [
        [1],
        "robot",
        None,
        {},
        {"robot": "x", "start": 0.0, "time_step": 0.01},
        {**HEADER, "parts": ["arm"]},
        {**HEADER, "parts": {"arm": {"kind": "Leg", "description": {}}}},
        {**HEADER, "parts": {"arm": {"kind": "Arm"}}},
        {**HEADER, "start": None},
        {**HEADER, "time_step": 0.0},
    ],
)
def test_a_header_that_is_none_is_named(tmp_path: Path, header: Any) -> None:
    assert "line 1 " in refusal(tmp_path, gzip.compress(text_of(header)))


def test_flipped_bits_are_found_wherever_they_are(tmp_path: Path) -> None:
    whole = gzip.compress(text_of(), mtime=0)
    for place in (*range(20, len(whole) - 8, len(whole) // 60), len(whole) - 7):
        damaged = bytearray(whole)
        damaged[place] ^= 0x10
        (tmp_path / TAPE_NAME).write_bytes(damaged)
        try:
            tape = read_tape(tmp_path)
        except ReplayError:
            continue
        assert tape.cut, f"a bit of byte {place} is another, and nobody says so"


@pytest.mark.parametrize("data", [b"", b"hello", gzip.compress(b"", mtime=0), gzip.compress(b"\xff\xfe\n", mtime=0)])
def test_what_is_no_tape_at_all_is_refused(tmp_path: Path, data: bytes) -> None:
    assert refusal(tmp_path, data)


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_one_that_was_cut_is_played_up_to_there_and_reports_it(tmp_path: Path, share: float) -> None:
    whole = gzip.compress(text_of())
    (tmp_path / TAPE_NAME).write_bytes(whole[: int(share * len(whole))])
    tape = read_tape(tmp_path)
    assert tape.cut
    assert 0 < len(tape.readings["arm", "positions"].times) < COUNT


def test_a_last_line_that_was_begun_is_a_cut(tmp_path: Path) -> None:
    (tmp_path / TAPE_NAME).write_bytes(gzip.compress(text_of()[:-10]))
    tape = read_tape(tmp_path)
    assert tape.cut
    assert len(tape.readings["arm", "positions"].times) == COUNT - 1
