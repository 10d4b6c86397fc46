"""Files that only one process writes at a time."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
from pathlib import Path
from typing import IO

from bestman_bt.configuration.errors import ConfigurationError, Problem

WITHOUT_FLOCK = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
"""Errors of a file system without locks, on which a lock file is used instead."""


def lock_for_writing(file: IO[bytes], path: Path, writer: str) -> Path | None:
    """Lock an open file until it is closed; return the lock file to delete then, if the file system needs one.
    ``writer``: the other possible holder, for the message. Raises ConfigurationError if the file is locked, OSError if
    locking fails.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise _held(path, f"another {writer} is writing it") from error
    except OSError as error:
        if error.errno not in WITHOUT_FLOCK:
            raise
        return _make_lock_file(path, writer)
    return None


def _make_lock_file(path: Path, writer: str) -> Path:
    mine, lock = f"process {os.getpid()} on {socket.gethostname()}", path.with_suffix(".lock")
    try:
        with lock.open("x", encoding="utf-8") as file:
            file.write(mine)
    except FileExistsError as error:
        theirs = lock.read_text(encoding="utf-8")
        if not _has_ended(theirs):
            why = f"another {writer} is writing it, {theirs}; if that has ended, delete {lock}"
            raise _held(path, why) from error
        lock.write_text(mine, encoding="utf-8")
    return lock


def _has_ended(holder: str) -> bool:
    """Return whether the process that a lock file names ran on this machine and has ended."""
    match holder.split():
        case ["process", number, "on", host] if number.isdecimal() and host == socket.gethostname():
            return not Path(f"/proc/{number}").exists()
    return False


def _held(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(path), None, "", why)])
