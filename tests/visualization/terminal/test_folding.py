from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.engine import RUNNING, SUCCESS
from bestman_bt.visualization import DescribedNode, NodeTransition, TreeDescription
from bestman_bt.visualization.node_states import NodeStates
from bestman_bt.visualization.terminal.folding import folded_nodes


def visible(tree, folded):
    shown, pending = [], [tree.root]
    while pending:
        node = pending.pop()
        shown.append(node.uid)
        if node.uid not in folded:
            pending.extend(tree.children(node.uid))
    return shown


def test_nothing_is_folded_where_there_is_room(fetch_nodes):
    tree = TreeDescription(fetch_nodes)
    assert folded_nodes(tree, NodeStates(tree), 10) == set()


def test_what_was_never_ticked_folds_before_what_succeeded(fetch_nodes):
    tree = TreeDescription(fetch_nodes)
    states = NodeStates(tree)
    states.apply([NodeTransition(uid, SUCCESS, 1.0) for uid in (3, 4, 5)])
    states.apply([NodeTransition(uid, RUNNING, 1.0) for uid in (0, 9)])
    assert folded_nodes(tree, states, 9) == {6}
    assert folded_nodes(tree, states, 7) == {6, 2} or folded_nodes(tree, states, 7) == {2}


@st.composite
def trees_with_runners(draw):
    parents = [draw(st.integers(max(0, uid - 6), uid - 1)) for uid in range(1, draw(st.integers(2, 40)))]
    nodes = [DescribedNode(0, "n", "Sequence", None)]
    nodes += [DescribedNode(uid, "n", "Sequence", parent) for uid, parent in enumerate(parents, start=1)]
    tree = TreeDescription(nodes)
    states = NodeStates(tree)
    leaf = draw(st.sampled_from(tree.leaves()))
    path = [leaf]
    while path[-1].parent is not None:
        path.append(tree.node(path[-1].parent))
    states.apply([NodeTransition(node.uid, RUNNING, 0.0) for node in reversed(path)])
    return tree, states, {node.uid for node in path}


@given(trees_with_runners(), st.integers(1, 40))
def test_what_runs_is_never_hidden_and_the_rest_fits_if_it_can(drawn, lines):
    tree, states, running = drawn
    shown = visible(tree, folded_nodes(tree, states, lines))
    assert running <= set(shown)
    everything_foldable = {node.uid for node in tree.nodes if tree.children(node.uid)} - running
    assert len(shown) <= max(lines, len(visible(tree, everything_foldable)))
