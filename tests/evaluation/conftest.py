"""One whole fetch, run once by the program itself, for all tests that look at what it left."""

from __future__ import annotations

import fcntl
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.cli.command_line import Answer, Program

SEED = 7


@dataclass(frozen=True)
class Fetch:
    """What ``bestman-bt run fetch_cup --seed 7 --json`` printed and left."""

    answer: Answer
    folder: Path

    @property
    def result(self) -> dict[str, Any]:
        return self.answer.document


@pytest.fixture(scope="session")
def fetch(tmp_path_factory: pytest.TempPathFactory) -> Fetch:
    """The fetch; processes that share the tests (pytest-xdist) share it too."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    said = shared / "fetch.json"
    with (shared / "fetch.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not said.exists():
            answer = Program(
                "run", "fetch_cup", "--seed", SEED, "--json", "--runs", shared / "runs", folder=shared
            ).answer()
            said.write_text(json.dumps([answer.code, answer.out, answer.err]))
    (folder,) = (shared / "runs").iterdir()
    return Fetch(Answer(*json.loads(said.read_text())), folder)
