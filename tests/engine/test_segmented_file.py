"""Logs that are cut into segments: nothing is lost or told twice, wherever they end."""

from __future__ import annotations

import lzma
import tracemalloc
from pathlib import Path

import pytest

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS, ManualClock, load_tree
from bestman_bt.engine.logs.btlog import BtLog, BtLogWriter, read_btlog
from bestman_bt.engine.logs.segmented_file import SMALLEST, SegmentedFile, full_segments, read_segment, read_segments

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Repeat num_cycles="-1"><Sequence>
  <AlwaysSuccess name="a"/><Sleep msec="100" name="b"/></Sequence></Repeat></BehaviorTree></root>"""


def all_bytes(path: Path) -> bytes:
    return b"".join(read_segment(segment, 1 << 20) for segment in [*full_segments(path), path])


def test_full_segments_are_compressed_and_all_is_there_once(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    file = SegmentedFile(path, segment=1000, keep=1 << 20)
    lines = [f"line {number}\n".encode() for number in range(500)]
    for line in lines:
        file.write(line)
    file.close()
    segments = full_segments(path)
    assert len(segments) > 3
    assert {segment.suffix for segment in segments} == {".xz"}
    assert path.stat().st_size <= 1000
    assert all_bytes(path) == b"".join(lines)


def test_the_oldest_go_but_the_first_stays(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    file = SegmentedFile(path, segment=1000, keep=500)
    for number in range(2000):
        file.write(f"line {number}\n".encode())
    file.close()
    segments = full_segments(path)
    assert segments[0].name == "log.0001.jsonl.xz"
    assert sum(segment.stat().st_size for segment in segments[1:]) <= 500
    assert all_bytes(path).endswith(b"line 1999\n")


def test_a_log_that_is_begun_anew_leaves_nothing_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    for _ in range(2):
        file = SegmentedFile(path, segment=100, keep=1 << 20)
        for number in range(100):
            file.write(f"{number}\n".encode())
        file.close()
    assert all_bytes(path).splitlines() == [str(number).encode() for number in range(100)]


def test_of_a_segment_that_was_being_compressed_the_whole_one_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"new\n")
    (tmp_path / "log.0001.jsonl").write_bytes(b"old\n")
    (tmp_path / "log.0001.jsonl.xz.part").write_bytes(lzma.compress(b"old\n")[:10])
    assert all_bytes(path) == b"old\nnew\n"
    (tmp_path / "log.0001.jsonl.xz").write_bytes(lzma.compress(b"old\n"))
    assert all_bytes(path) == b"old\nnew\n"


@pytest.mark.parametrize("damage", [lambda data: data[:-200], lambda data: data[:40] + b"\xff\xff" + data[42:]])
def test_a_damaged_segment_ends_early(tmp_path: Path, damage: object) -> None:
    path = tmp_path / "log.0001.jsonl.xz"
    data = "".join(f"line {number * number}\n" for number in range(3000)).encode()
    path.write_bytes(damage(lzma.compress(data)))
    found = read_segment(path, 1 << 20)
    assert len(found) < len(data)


@pytest.mark.slow
def test_a_segment_that_unpacks_to_more_than_allowed_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "log.0001.jsonl.xz"
    path.write_bytes(lzma.compress(bytes(50 << 20)))
    assert len(read_segment(path, 1 << 20)) == 1 << 20


def test_a_btlog_in_segments_reads_as_one_in_a_single_file(tmp_path: Path) -> None:
    read = []
    for name, segment in (("whole", 1 << 20), ("cut", 900)):
        clock = ManualClock()
        tree = load_tree(TREE, clock=clock)
        with BtLogWriter(tree, tmp_path / f"{name}.btlog", start=1000.0, segment=segment):
            for _ in range(100):
                tree.tick_once()
                clock.advance(0.05)
        read.append(read_btlog(tmp_path / f"{name}.btlog"))
    assert 2 <= len(full_segments(tmp_path / "cut.btlog")) <= 4
    assert read[0].xml == read[1].xml
    assert read[0].start == read[1].start == 1000.0
    assert read[0].transitions == read[1].transitions
    alone = read_btlog(_only(tmp_path / "cut.btlog", tmp_path / "alone"))
    assert {transition.status for transition in alone.transitions[:3]} != {IDLE}  # how all stood at its beginning


def _states_at_end(log: BtLog) -> dict[int, int]:
    states = {change.uid: change.status for change in log}
    return {uid: state for uid, state in states.items() if state != IDLE}


def _record(microseconds: int, uid: int, status: int) -> bytes:
    return microseconds.to_bytes(6, "little") + uid.to_bytes(2, "little") + bytes([status])


def _write_segments(folder: Path, *segments: tuple[str, list[bytes]]) -> Path:
    """Logs of the same tree, one a segment."""
    with BtLogWriter(load_tree(TREE, clock=ManualClock()), folder / "head.btlog", start=1000.0):
        pass
    head = (folder / "head.btlog").read_bytes()
    for name, records in segments:
        (folder / name).write_bytes(head + b"".join(records))
    return folder / "run.btlog"


def test_nodes_that_do_not_stand_after_missing_segments_are_idle_and_the_gap_is_reported(tmp_path: Path) -> None:
    first = [_record(0, 1, RUNNING), _record(0, 2, RUNNING), _record(5_000_000, 3, FAILURE)]
    after = [_record(60_000_000, 1, RUNNING), _record(60_000_000, 4, RUNNING), _record(61_000_000, 4, SUCCESS)]
    log = read_btlog(_write_segments(tmp_path, ("run.0001.btlog", first), ("run.btlog", after)))
    assert log.gaps == ()
    (tmp_path / "run.btlog").rename(tmp_path / "run.0005.btlog")
    (tmp_path / "run.btlog").write_bytes(b"")  # killed before its head was written
    log = read_btlog(tmp_path / "run.btlog")
    assert log.gaps == ((5.0, 60.0),)
    assert [(change.time, change.uid, change.status) for change in log][3:] == [
        (60.0, 2, IDLE),
        (60.0, 3, IDLE),
        (60.0, 4, RUNNING),
        (61.0, 4, SUCCESS),
    ]
    assert _states_at_end(log) == {1: RUNNING, 4: SUCCESS}


def test_a_segment_that_is_no_log_is_a_gap(tmp_path: Path) -> None:
    path = _write_segments(
        tmp_path, ("run.0001.btlog", [_record(0, 1, RUNNING)]), ("run.btlog", [_record(9_000_000, 1, RUNNING)])
    )
    (tmp_path / "run.0002.btlog").write_bytes(b"no log")
    assert read_btlog(path).gaps == ((0.0, 9.0),)


def test_a_log_is_read_up_to_a_total_limit_the_first_and_the_newest_segments(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    for number in range(1, 6):
        (tmp_path / f"log.{number:04}.jsonl").write_bytes(bytes([number]) * (100 << 10))
    path.write_bytes(b"\x06")
    segments = read_segments(path, 350 << 10, 200 << 10)
    assert [(segment.path.name, segment.is_after_gap) for segment in segments] == [
        ("log.0001.jsonl", False),
        ("log.0004.jsonl", True),
        ("log.0005.jsonl", False),
        ("log.jsonl", False),
    ]
    path.unlink()  # the process ended between two segments
    assert [segment.path.name for segment in read_segments(path, 1 << 20, 1 << 20)][-1] == "log.0005.jsonl"


def test_the_head_of_a_btlog_is_there_at_once(tmp_path: Path) -> None:
    with BtLogWriter(load_tree(TREE, clock=ManualClock()), tmp_path / "run.btlog"):
        assert len(read_btlog(tmp_path / "run.btlog").transitions) == 0


def _only(path: Path, folder: Path) -> Path:
    folder.mkdir()
    return path.rename(folder / path.name)


def test_segments_with_almost_nothing_in_them_count_as_much_as_small_ones(tmp_path: Path) -> None:
    for number in range(1, 41):
        (tmp_path / f"log.{number:04}.jsonl").write_bytes(b"x")
    (tmp_path / "log.jsonl").write_bytes(b"")
    segments = read_segments(tmp_path / "log.jsonl", 10 * SMALLEST, 1 << 20)
    assert [segment.path.name for segment in segments][:2] == ["log.0001.jsonl", "log.0032.jsonl"]
    assert len(segments) == 11


def test_of_a_long_log_one_segment_is_in_memory_at_a_time(tmp_path: Path) -> None:
    for number in range(1, 21):
        (tmp_path / f"log.{number:04}.jsonl.xz").write_bytes(lzma.compress(bytes(1 << 20), preset=0))
    (tmp_path / "log.jsonl").write_bytes(b"")
    tracemalloc.start()
    try:
        segments = read_segments(tmp_path / "log.jsonl", 1 << 30, 1 << 22)
        assert sum(len(segment.data) for segment in segments) == 20 << 20
        assert tracemalloc.get_traced_memory()[1] < 6 << 20
    finally:
        tracemalloc.stop()


def test_a_segment_that_is_compressed_while_a_log_is_read_is_read_as_well(tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"new")
    plain = tmp_path / "log.0001.jsonl"
    plain.write_bytes(b"old")
    full, growing = read_segments(tmp_path / "log.jsonl", 1 << 20, 1 << 20)
    (tmp_path / "log.0001.jsonl.xz").write_bytes(lzma.compress(b"old"))
    plain.unlink()
    (tmp_path / "log.jsonl").write_bytes(b"newer")
    assert (full.data, growing.data) == (b"old", b"new")
