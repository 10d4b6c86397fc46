"""What holds for all tests: they never meet the robots of whoever runs them."""

from __future__ import annotations

import gc
import os
import shutil
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from xdist.scheduler import LoadFileScheduling

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import PYBULLET_HAS_WHEELS

# As in `bestman-bt` itself, before NumPy is imported: the workers are as many as the processors.
for limit in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(limit, "1")

REAL_TIME_FOLDERS = ("tests/hal/", "tests/monitor/")
"""Where the Makefile looks for tests against real-time clocks: to collect all others costs seconds in each process."""
SLOW = 10
"""How many quick tests take as long as one marked slow, about."""


def file_of(item: pytest.Item) -> str:
    """Return the test's file, as node IDs name it."""
    return item.nodeid.split("::", 1)[0]


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Generator[None]:
    """Refuses tests against real-time clocks that ``make test`` would not find; in workers, longest files come first.

    So no worker begins a long file when the others have nothing left to do. Of a test with ``quick_cases(n)``, ``n``
    cases stay quick, spread evenly from the first to the last.
    """
    cases: defaultdict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("real_time") and not item.nodeid.startswith(REAL_TIME_FOLDERS):
            raise pytest.UsageError(f"{item.nodeid}: real_time tests belong to {' or '.join(REAL_TIME_FOLDERS)}")
        if item.get_closest_marker("quick_cases"):
            cases[item.nodeid.split("[", 1)[0]].append(item)
    for same_test in cases.values():
        (count,) = same_test[0].get_closest_marker("quick_cases").args
        quick = {round(index * (len(same_test) - 1) / max(count - 1, 1)) for index in range(count)}
        for index, item in enumerate(same_test):
            if index not in quick:
                item.add_marker("slow")
    yield
    if hasattr(config, "workerinput"):
        length: Counter[str] = Counter()
        for item in items:
            length[file_of(item)] += SLOW if item.get_closest_marker("slow") else 1
        items.sort(key=lambda item: -length[file_of(item)])


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    """Files are dealt in the order in which the workers have collected them."""
    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected stays out of garbage collection: loading a tree in Python asks for one, of half a second."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """Skips what needs PyBullet on a Python for which it has no wheels; elsewhere a missing PyBullet is an error."""
    try:
        return (yield)
    except MissingExtraError as error:
        if error.name == "pybullet" and not PYBULLET_HAS_WHEELS:
            pytest.skip(str(error))  # which names the package, the reason and this Python
        raise


pytest_runtest_setup = pytest_runtest_call
"""Fixtures, too."""


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


@pytest.fixture(autouse=True, scope="session")
def shipped_files_are_understood_once() -> Iterator[None]:
    """What a shipped file says of a robot, an object or a piece of furniture is the same for all tests of a process."""
    from bestman_bt.configuration.data import data_root, pybullet_data
    from bestman_bt.configuration.document import Document
    from bestman_bt.robot_model import compose
    from bestman_bt.scene import furniture_file, object_file

    def once(function: Callable[..., Any]) -> Callable[..., Any]:
        made: dict[tuple[str, ...], Any] = {}

        def known(name: str, document: Document, *folder: Path) -> Any:
            sources = {source for source, _ in document.origins.values()}
            # Whatever else has a say, such as an option, is read anew; so are files that a test has written.
            files = [Path(source).resolve() for source in sources]
            if not files or not all(file.is_file() and file.is_relative_to(data_root()) for file in files):
                return function(name, document, *folder)
            # Tests hide PyBullet, whose models then lie elsewhere.
            key = (name, repr(document.data), repr(document.origins), str(pybullet_data()))
            if key not in made:
                made[key] = function(name, document, *folder)
            return made[key]

        return known

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compose, "compose_robot", once(compose.compose_robot))
        patch.setattr(object_file, "object_of", once(object_file.object_of))
        for name in ("_written", "_generated"):
            patch.setattr(furniture_file, name, once(getattr(furniture_file, name)))
        yield
