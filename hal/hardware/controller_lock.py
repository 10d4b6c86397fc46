"""One client to a controller: a second one of the same user on the same machine is refused before it connects."""

from __future__ import annotations

import fcntl
import hashlib
import os
import time
from contextlib import suppress

from bestman_bt.runtime_folder import runtime_folder
from hal.parts import ConnectionFailedError

PATIENCE = 3.0
"""Seconds that a new client waits: the robot process of a program that was killed brings the robot to rest first."""


class ControllerLock:
    """Holds the place of the only client of one controller from ``take`` to ``release``, or to the end of the process.

    A file lock (flock) in the user's runtime folder, which the kernel releases with the process, however that ends. The
    file is named by a digest, so that the address stands nowhere in clear, and holds the number of the process.
    """

    def __init__(self, name: str, driver: str, address: str) -> None:
        self._name = name
        self._file = hashlib.sha256(f"{driver} {address.strip().lower()}".encode()).hexdigest()[:24] + ".lock"
        self._descriptor: int | None = None

    def take(self) -> None:
        """Acquire the exclusive lock of the controller; idempotent. Raises ConnectionFailedError naming the holder."""
        if self._descriptor is not None:
            return
        try:
            descriptor = os.open(runtime_folder() / self._file, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise ConnectionFailedError(
                f"{self._name}: no lock can be had against a second client: {error.strerror or error}"
            ) from error
        deadline = time.monotonic() + PATIENCE
        while not _locked(descriptor):
            if time.monotonic() > deadline:
                holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
                os.close(descriptor)
                who = f"process {holder}" if holder else "another program"
                raise ConnectionFailedError(
                    f"{self._name}: {who} on this machine is connected to its controller already; "
                    "it could not tell the two apart and would follow both"
                )
            time.sleep(0.05)
        with suppress(OSError):  # the number is for people; the lock is what counts
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, str(os.getpid()).encode(), 0)
        self._descriptor = descriptor

    def release(self) -> None:
        """Let others have it; idempotent."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _locked(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
