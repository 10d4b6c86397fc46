"""The examples of plug-ins are chosen as a user's own algorithms are."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.registry import PLUGIN_EXAMPLES
from bestman_bt.runtime.algorithms import SLOTS, make_algorithm

SOURCES = Path(__file__).parents[2]
EXAMPLES = [
    (slot, old, place)
    for old, place in PLUGIN_EXAMPLES.items()
    for slot in ("unknown_grasp_pose" if old.startswith("grasp_pose") else old.partition("/")[0],)
]


@pytest.mark.parametrize(("slot", "old", "place"), EXAMPLES, ids=[old for _, old, _ in EXAMPLES])
def test_the_old_name_is_refused_with_the_place_that_works(slot: str, old: str, place: str, kitchen) -> None:
    name = old.partition("/")[2]
    with pytest.raises(ConfigurationError, match=f"{name!r} is a plug-in now: name it as '{place}'"):
        make_algorithm(load_run("fetch_cup", settings=[f"algorithms.{slot}.algorithm={name}"]), slot)
    run = load_run("fetch_cup", settings=[f"algorithms.{slot}.algorithm={SOURCES / place}"])
    needs = (kitchen,) if slot == "localization" else ()
    assert isinstance(make_algorithm(run, slot, *needs), SLOTS[slot].base)
