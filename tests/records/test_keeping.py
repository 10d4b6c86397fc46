from __future__ import annotations

import errno
import os

import pytest

from bestman_bt.records.keeping import RecordingErrors


def test_a_file_that_failed_once_has_no_gap_and_the_others_are_written_on(capsys: pytest.CaptureFixture[str]) -> None:
    keeping, written = RecordingErrors(), list[str]()

    def full() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    assert keeping.write("motion.jsonl", lambda: written.append("first"))
    assert not keeping.write("motion.jsonl", full)
    assert not keeping.write("motion.jsonl", lambda: written.append("after the gap"))  # though there is room again
    assert keeping.write("transitions.btlog", lambda: written.append("other"))
    assert written == ["first", "other"]
    assert not keeping.write("transitions.btlog", full)
    assert keeping.lost == dict.fromkeys(("motion.jsonl", "transitions.btlog"), os.strerror(errno.ENOSPC))
    assert capsys.readouterr().err.count("NOT KEPT") == 1
