"""What holds for all tests: they never meet the robots of whoever runs them."""

from __future__ import annotations

import gc
import shutil
import tempfile
from collections.abc import Generator, Iterator

import pytest
from xdist.scheduler import LoadFileScheduling

REAL_TIME_FOLDERS = ("tests/hal/", "tests/monitor/")
"""Where the Makefile looks for tests against real-time clocks: to collect all others costs seconds in each process."""
UR = "tests/hal/ur/"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuses tests against real-time clocks that ``make test`` would not find."""
    for item in items:
        if item.get_closest_marker("real_time") and not item.nodeid.startswith(REAL_TIME_FOLDERS):
            raise pytest.UsageError(f"{item.nodeid}: real_time tests belong to {' or '.join(REAL_TIME_FOLDERS)}")


class _Scheduling(LoadFileScheduling):
    """A file's tests run one after the other, and so do all tests of a UR.

    Set-points, controller and protocol of one UR at 500 Hz take most of a processor with real-time priority.
    """

    def _split_scope(self, nodeid: str) -> str:
        return UR if nodeid.startswith(UR) else str(super()._split_scope(nodeid))


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> _Scheduling:
    return _Scheduling(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays out of garbage collection: loading a tree in Python asks for one, of half a second."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_unconfigure() -> None:
    """Let the interpreter clean up as ever."""
    gc.unfreeze()


@pytest.fixture(autouse=True, scope="session")
def own_runtime_folder() -> Iterator[None]:
    """Sockets and locks lie in a folder of this process, with a short path: `stop` reaches no other robot."""
    folder = tempfile.mkdtemp(prefix="bt-")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", folder)
        yield
    shutil.rmtree(folder, ignore_errors=True)
