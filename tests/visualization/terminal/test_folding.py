from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.engine import RUNNING, SUCCESS
from bestman_bt.records.states import NodeStates, StateHistory
from bestman_bt.visualization.terminal import folded_nodes
from tests.visualization.conftest import nodes_of, tree_of


def standing(count, *changes):
    history = StateHistory()
    history.now = NodeStates(count)
    history.record(0.0, 0, changes)
    return history.now


def visible(tree, folded):
    shown, pending = [], [tree[0]]
    while pending:
        node = pending.pop()
        shown.append(node.uid)
        if node.uid not in folded:
            pending.extend(tree.children(node.uid))
    return shown


def test_nothing_is_folded_where_there_is_room(fetch_tree):
    tree = nodes_of(fetch_tree)
    assert folded_nodes(tree, NodeStates(10), 10) == set()


def test_what_was_never_ticked_folds_before_what_succeeded(fetch_tree):
    tree = nodes_of(fetch_tree)
    states = standing(10, *((uid, SUCCESS) for uid in (4, 5, 6)), *((uid, RUNNING) for uid in (1, 10)))
    assert folded_nodes(tree, states, 9) == {7}
    assert folded_nodes(tree, states, 7) == {7, 3} or folded_nodes(tree, states, 7) == {3}


@st.composite
def trees_with_runners(draw):
    parents = [draw(st.integers(max(1, uid - 6), uid - 1)) for uid in range(2, draw(st.integers(3, 41)))]
    tree = nodes_of(tree_of(*((parent, "n", "Sequence") for parent in (None, *parents))))
    leaf = draw(st.sampled_from(tree.leaves()))
    path = [leaf]
    while path[-1].parent is not None:
        path.append(tree.node(path[-1].parent))
    states = standing(len(tree), *((node.uid, RUNNING) for node in reversed(path)))
    return tree, states, {node.uid for node in path}


@given(trees_with_runners(), st.integers(1, 40))
def test_what_runs_is_never_hidden_and_the_rest_fits_if_it_can(drawn, lines):
    tree, states, running = drawn
    shown = visible(tree, folded_nodes(tree, states, lines))
    assert running <= set(shown)
    everything_foldable = {node.uid for node in tree if tree.children(node.uid)} - running
    assert len(shown) <= max(lines, len(visible(tree, everything_foldable)))
