"""The folder for sockets and locks of the user's running programs."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from pathlib import Path


def runtime_folder() -> Path:
    """Return the user's folder for sockets and locks, mode 0700; created if missing.

    Raises PermissionError if another user owns its name.
    """
    base = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir())
    folder = (base if base.is_dir() else Path(tempfile.gettempdir())) / f"bestman-bt-{os.getuid()}"
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()  # of a link itself: it could lead elsewhere a moment later
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise PermissionError(f"{folder} is not a folder of this user")
    folder.chmod(0o700)
    return folder
