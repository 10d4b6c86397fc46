from __future__ import annotations

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.visualization import DescribedNode, NodeTransition, TreeDescription
from bestman_bt.visualization.terminal import NodeEvents


def told(nodes, *batches):
    events = NodeEvents(TreeDescription(nodes))
    return [str(event) for batch in batches for event in events.of(batch)]


def test_leaves_that_start_and_end_are_told_and_their_parents_are_not(fetch_nodes):
    lines = told(
        fetch_nodes,
        [NodeTransition(2, RUNNING, 1.0), NodeTransition(5, RUNNING, 1.0)],
        [NodeTransition(5, FAILURE, 2.5, "SLIPPED: the cup fell"), NodeTransition(2, FAILURE, 2.5)],
    )
    assert lines == ["[   1.00 s] ▶ Grasp running", "[   2.50 s] ✗ Grasp failure: SLIPPED: the cup fell"]


def test_a_condition_that_is_checked_at_every_tick_is_told_once_until_it_changes(fetch_nodes):
    holds = [NodeTransition(4, SUCCESS, 1.0), NodeTransition(4, IDLE, 1.0)]
    broken = [NodeTransition(4, FAILURE, 2.0, "nothing in the hand"), NodeTransition(4, IDLE, 2.0)]
    lines = told(fetch_nodes, holds, holds, holds, broken, broken, holds)
    assert [line.split("s] ")[1] for line in lines] == [
        "✓ PlanGrasp success",
        "✗ PlanGrasp failure: nothing in the hand",
        "✓ PlanGrasp success",
    ]


def test_a_second_attempt_is_told_again(fetch_nodes):
    attempt = [NodeTransition(5, RUNNING, 1.0), NodeTransition(5, FAILURE, 2.0), NodeTransition(5, IDLE, 2.0)]
    assert len(told(fetch_nodes, attempt, attempt)) == 4


def test_a_halted_leaf_that_starts_again_is_told_again(fetch_nodes):
    halted = [NodeTransition(1, RUNNING, 1.0), NodeTransition(1, IDLE, 2.0)]
    assert len(told(fetch_nodes, halted, halted)) == 2


def test_the_end_of_the_tree_is_told(fetch_nodes):
    assert told(fetch_nodes, [NodeTransition(0, SUCCESS, 9.0), NodeTransition(0, IDLE, 9.0)]) == [
        "[   9.00 s] ✓ → fetch success"
    ]


ASKING = [
    DescribedNode(0, "fetch", "Sequence", None),
    DescribedNode(1, "held", "Holding", 0, condition=True),
    DescribedNode(2, "grasp", "Grasp", 0),
]


def test_a_condition_that_does_not_hold_answers_no_which_is_not_told_as_a_failure():
    assert told(ASKING, [NodeTransition(1, FAILURE, 1.0, "the hand is empty")]) == [
        "[   1.00 s] – held no: the hand is empty"
    ]


def test_a_condition_that_ends_the_tree_is_told_as_a_failure_and_one_before_it_is_not():
    ending = [
        NodeTransition(1, FAILURE, 2.0, "the hand is empty"),
        NodeTransition(2, FAILURE, 2.0, "slipped"),
        NodeTransition(0, FAILURE, 2.0),
    ]
    lines = [line.split("s] ")[1] for line in told(ASKING, ending)]
    assert lines[0].startswith("– held")
    assert lines[1].startswith("✗ grasp")
    lines = [line.split("s] ")[1] for line in told(ASKING, [ending[0], ending[2]])]
    assert lines[0].startswith("✗ held")
