"""Where this user's programs leave what others of them look for while they run: sockets and locks."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def runtime_folder() -> Path:
    """A folder of mode 0700, for this run of the machine; PermissionError where somebody else has taken its name."""
    base = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir())
    folder = (base if base.is_dir() else Path(tempfile.gettempdir())) / f"bestman-bt-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to another user")
    folder.chmod(0o700)
    return folder
