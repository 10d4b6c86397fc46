"""What holds for all tests: they never meet the robots of whoever runs them."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_runtime_folder() -> Iterator[None]:
    """Sockets and locks lie in a folder of this process, with a short path: `stop` reaches no other robot."""
    folder = tempfile.mkdtemp(prefix="bt-")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", folder)
        yield
    shutil.rmtree(folder, ignore_errors=True)
