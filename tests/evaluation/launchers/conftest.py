"""The Slurm of tests: the one that answers here, else one of their own."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.evaluation.launchers.one_machine_slurm import answers, one_machine_slurm, why_none


@pytest.fixture(scope="session")
def slurm() -> Iterator[None]:
    if answers():
        yield
        return
    if why := why_none():
        pytest.skip(f"no Slurm answers on this machine, and {why}")
    with tempfile.TemporaryDirectory(prefix="bestman_bt_slurm_") as folder:
        Path(folder).chmod(0o755)
        with one_machine_slurm(Path(folder)):
            yield
