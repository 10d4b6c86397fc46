"""Each slot for algorithms has properties in this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.registry import ALGORITHMS
from bestman_bt.runtime.algorithms import SLOTS


@pytest.mark.parametrize("slot", SLOTS)
def test_an_algorithm_of_each_slot_has_properties(slot):
    texts = [file.read_text() for file in Path(__file__).parent.glob("test_*.py")]
    found = [one for one, _ in ALGORITHMS.of_kind(SLOTS[slot].kind).values() if issubclass(one, SLOTS[slot].base)]
    assert any(f"{one.__name__}(" in text for one in found for text in texts)
