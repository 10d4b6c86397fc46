from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.runtime import Session
from bestman_bt.scene import draw_world, load_scene
from tests.evaluation.predicates.staged import Staged, judged, why

NAMES = ("cup", "can", "box", "soup_can")
TIDY = {
    "scene": "untidy_table",
    "tidy": {
        "objects": list(NAMES),
        "source": "table",
        "surface": "counter/top",
        "x": ["-25 cm", "0 cm"],
        "y": ["-60 cm", "60 cm"],
    },
    "predicate": "tidied",
}
SEED = 2


def on_counter(name: str, x: float, y: float) -> Callable[[Session], Pose]:
    def where(session: Session) -> Pose:
        height = float(session.setup.world_model.models[name].size[2])
        counter = next(p for p in session.setup.world.furniture if p.name == "counter")
        return counter.pose @ counter.model.surfaces[0].pose @ Pose(np.array([x, y, height / 2 + 1e-4]))

    return where


def brought(*names: str, x: float = -0.12) -> Staged:
    return Staged(moved={name: on_counter(name, x, -0.4 + 0.25 * NAMES.index(name)) for name in names})


@pytest.fixture(scope="module")
def present() -> tuple[str, ...]:
    return tuple(thing.name for thing in draw_world(load_scene("untidy_table"), SEED).objects)


def test_all_things_in_the_region_are_tidy(tmp_path: Path, present: tuple[str, ...]) -> None:
    result = judged(tmp_path, TIDY, brought(*present), SEED)
    assert result.failure is None or result.failure.node == "audit", result.failure
    assert result.predicate is True
    assert result.metrics == {"outside_mm": 0.0, "tidied_share": 1.0}


def test_one_that_was_left_on_the_table_is_named(tmp_path: Path, present: tuple[str, ...]) -> None:
    result = judged(tmp_path, TIDY, brought(*(name for name in present if name != "cup")), SEED)
    assert why(result).startswith("the cup is ")
    assert "not standing on the counter" in why(result)
    assert result.metrics["tidied_share"] == pytest.approx(1 - 1 / len(present), abs=1e-3)


def test_on_the_counter_but_outside_the_region_is_not_tidy(tmp_path: Path, present: tuple[str, ...]) -> None:
    result = judged(tmp_path, TIDY, brought(*present, x=0.10), SEED)
    assert result.predicate is False
    assert result.metrics["outside_mm"] == pytest.approx(100.0, abs=2.0)


def test_a_table_that_nobody_tidied_is_not_tidy(tmp_path: Path) -> None:
    result = judged(tmp_path, TIDY, Staged(), SEED)
    assert result.predicate is False
    assert result.metrics["tidied_share"] == 0.0
