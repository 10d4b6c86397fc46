from __future__ import annotations

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.records.history import RunHistory
from bestman_bt.visualization.terminal import NodeEvents
from tests.visualization.conftest import changed, tree_of


def told(tree, *batches):
    history = RunHistory()
    history.take(tree)
    events = NodeEvents(history)
    return [str(event) for batch in batches for event in events.of(batch)]


def test_leaves_that_start_and_end_are_reported_and_their_parents_are_not(fetch_tree):
    lines = told(
        fetch_tree,
        changed(1.0, (3, RUNNING), (6, RUNNING)),
        changed(2.5, (6, FAILURE, "SLIPPED: the cup fell"), (3, FAILURE)),
    )
    assert lines == ["[   1.00 s] ▶ Grasp running", "[   2.50 s] ✗ Grasp failure: SLIPPED: the cup fell"]


def test_a_condition_that_is_checked_at_every_tick_is_reported_once_until_it_changes(fetch_tree):
    holds = changed(1.0, (5, SUCCESS), (5, IDLE))
    broken = changed(2.0, (5, FAILURE, "nothing in the hand"), (5, IDLE))
    lines = told(fetch_tree, holds, holds, holds, broken, broken, holds)
    assert [line.split("s] ")[1] for line in lines] == [
        "✓ PlanGrasp success",
        "✗ PlanGrasp failure: nothing in the hand",
        "✓ PlanGrasp success",
    ]


def test_a_second_attempt_is_reported_again(fetch_tree):
    attempt = (changed(1.0, (6, RUNNING)), changed(2.0, (6, FAILURE), (6, IDLE)))
    assert len(told(fetch_tree, *attempt, *attempt)) == 4


def test_a_halted_leaf_that_starts_again_is_reported_again(fetch_tree):
    halted = (changed(1.0, (2, RUNNING)), changed(2.0, (2, IDLE)))
    assert len(told(fetch_tree, *halted, *halted)) == 2


def test_the_end_of_the_tree_is_reported(fetch_tree):
    assert told(fetch_tree, changed(9.0, (1, SUCCESS), (1, IDLE))) == ["[   9.00 s] ✓ → fetch success"]


ASKING = tree_of((None, "fetch", "Sequence"), (1, "held", "Holding"), (1, "grasp", "Grasp"))


def test_a_condition_that_does_not_hold_answers_no_which_is_not_told_as_a_failure():
    assert told(ASKING, changed(1.0, (2, FAILURE, "the hand is empty"))) == ["[   1.00 s] – held no: the hand is empty"]


def test_a_condition_that_ends_the_tree_is_reported_as_a_failure_and_one_before_it_is_not():
    held, grasp = (2, FAILURE, "the hand is empty"), (3, FAILURE, "slipped")
    lines = [line.split("s] ")[1] for line in told(ASKING, changed(2.0, held, grasp, (1, FAILURE)))]
    assert lines[0].startswith("– held")
    assert lines[1].startswith("✗ grasp")
    lines = [line.split("s] ")[1] for line in told(ASKING, changed(2.0, held, (1, FAILURE)))]
    assert lines[0].startswith("✗ held")
