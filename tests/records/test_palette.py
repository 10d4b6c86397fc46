from __future__ import annotations

import pytest

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.palette import LOOKS, appearance_of, css_variables
from bestman_bt.records.states import NO, NodeStates, StateHistory


def told(*states: int) -> NodeStates:
    """Node 1 after it took these states."""
    history = StateHistory()
    history.now = NodeStates(1)
    for state in states:
        history.record(0.0, 0, [(1, state)])
    return history.now


@pytest.mark.parametrize(
    ("states", "word"),
    [
        ((), "idle"),
        ((SUCCESS, IDLE), "succeeded"),
        ((FAILURE, IDLE), "failed"),
        ((NO, IDLE), "was no"),
        ((RUNNING, IDLE), "halted"),
        ((SKIPPED, IDLE), "idle"),
        ((SUCCESS, IDLE, RUNNING), "running"),
        ((SUCCESS, IDLE, RUNNING, IDLE), "halted"),
        ((NO,), "no"),
    ],
)
def test_an_idle_node_still_reports_how_it_ended(states: tuple[int, ...], word: str) -> None:
    assert appearance_of(told(*states), 1).word == word


def test_every_state_has_a_colour_and_an_icon_of_its_own() -> None:
    for part in ("icon", "light", "dark"):
        assert len({getattr(look, part) for look in LOOKS.values()}) == len(LOOKS)


def test_style_sheets_have_the_colours_that_python_has() -> None:
    light, dark = css_variables().split("@media")
    assert "--running: #{:02x}{:02x}{:02x};".format(*LOOKS[RUNNING].light) in light
    assert "--running: #{:02x}{:02x}{:02x};".format(*LOOKS[RUNNING].dark) in dark
