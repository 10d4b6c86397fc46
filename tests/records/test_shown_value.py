"""Whatever is on a blackboard can be shown, and is short."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bestman_bt.records.shown_value import LONGEST_TEXT, show_value


class Rude:
    def to_string(self) -> str:
        raise RuntimeError("not today")


@dataclass
class Scan:
    points: np.ndarray = field(default_factory=lambda: np.zeros((5000, 3)))


@pytest.mark.parametrize(
    ("value", "text", "plain"),
    [
        (None, "", None),
        (True, "true", True),
        (3, "3", 3),
        (0.25, "0.25", 0.25),
        ("cup", "cup", "cup"),
        ([1, 2], "[1, 2]", [1, 2]),
        (float("nan"), "nan", None),
        (2**60, str(2**60), None),
        (Rude(), "cannot be shown: RuntimeError", None),
    ],
)
def test_a_value_has_a_text_and_itself_where_it_is_plain(value: Any, text: str, plain: Any) -> None:
    shown = show_value(value)
    assert shown.value == plain
    assert shown.text == text


@pytest.mark.parametrize(
    "value",
    [
        "x" * 10_000,
        list(range(10_000)),
        [["y" * 1000] * 8] * 8,
        Scan(),
        np.zeros((400, 400)),
        {i: "z" * 99 for i in range(999)},
    ],
)
def test_a_large_value_is_cut_short(value: Any) -> None:
    shown = show_value(value)
    assert 0 < len(shown.text) <= LONGEST_TEXT
    assert len(json.dumps(shown.value)) <= 2 * LONGEST_TEXT
