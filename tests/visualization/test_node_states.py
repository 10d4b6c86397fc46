from __future__ import annotations

import pytest

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.visualization import DescribedNode, NodeTransition, TreeDescription, VisualizationError
from bestman_bt.visualization.node_states import NodeStates


@pytest.fixture
def states(fetch_nodes):
    return NodeStates(TreeDescription(fetch_nodes))


@pytest.mark.parametrize(
    ("before", "word"), [(SUCCESS, "succeeded"), (FAILURE, "failed"), (RUNNING, "halted"), (IDLE, "idle")]
)
def test_an_idle_node_still_tells_how_it_ended(states, before, word):
    states.apply([NodeTransition(5, before, 1.0), NodeTransition(5, IDLE, 2.0)])
    assert states.state(5) == IDLE
    assert states.look(5).word == word
    states.apply([NodeTransition(5, IDLE, 3.0)])
    assert states.look(5).word == word, "reset once more"


def test_the_message_of_a_failure_outlives_the_reset_and_goes_with_the_next_start(states):
    states.apply([NodeTransition(5, FAILURE, 1.0, "SLIPPED: the cup fell"), NodeTransition(5, IDLE, 1.0)])
    assert states.message(5) == "SLIPPED: the cup fell"
    states.apply([NodeTransition(5, RUNNING, 2.0)])
    assert states.message(5) == ""


def test_states_that_no_engine_has_are_refused(states):
    with pytest.raises(VisualizationError, match="'Grasp': state 9"):
        states.apply([NodeTransition(5, 9, 1.0)])


def test_every_state_has_a_colour_and_an_icon_of_its_own_while_it_lasts(states):
    looks = []
    for state in (IDLE, RUNNING, SUCCESS, FAILURE):
        states.apply([NodeTransition(1, state, 0.0)])
        looks.append(states.look(1))
    assert len({look.color for look in looks}) == 4
    assert len({look.icon for look in looks}) == 4


def test_a_condition_that_does_not_hold_looks_like_an_answer_until_it_ends_the_tree():
    nodes = [DescribedNode(0, "fetch", "Sequence", None), DescribedNode(1, "held", "Holding", 0, condition=True)]
    states = NodeStates(TreeDescription(nodes))
    no = NodeTransition(1, FAILURE, 1.0)
    states.apply([no])
    assert states.look(1).word == "no"
    states.apply([NodeTransition(1, IDLE, 1.0)])
    assert states.look(1).word == "was no"
    states.apply([no, NodeTransition(0, FAILURE, 2.0)])
    assert states.look(1).word == "failure"
    states.apply([NodeTransition(1, IDLE, 2.0), NodeTransition(0, IDLE, 2.0)])
    assert states.look(1).word == "failed", "the tree has ended by it"
    states.apply([NodeTransition(0, RUNNING, 3.0), no])
    assert states.look(1).word == "no", "begun anew"
