"""A simulated robot that stands at the table, in arm's reach of the cup."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from bestman_bt.runtime import Session, session
from tests.behaviours.at_the_table import AT_THE_TABLE


@pytest.fixture
def at_table() -> Iterator[Session]:
    """A robot of its own for each test."""
    with session(seed=1, settings=AT_THE_TABLE) as opened:
        yield opened


@pytest.fixture(scope="module")
def bystander() -> Iterator[Session]:
    """One robot for all tests of a module that leave the world as it is."""
    with session(seed=1, settings=AT_THE_TABLE) as opened:
        yield opened
