from __future__ import annotations

import pytest

from bestman_bt.visualization import DescribedNode, TreeDescription, VisualizationError


def test_depth_first_order_reads_a_parent_before_its_children_left_to_right(fetch_nodes):
    shuffled = [fetch_nodes[i] for i in (0, 1, 2, 9, 3, 6, 7, 8, 4, 5)]
    assert [node.uid for node in TreeDescription(shuffled).depth_first()] == [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_leaves_and_depths_follow_from_the_parents(fetch_nodes):
    tree = TreeDescription(fetch_nodes)
    assert [leaf.uid for leaf in tree.leaves()] == [1, 4, 5, 7, 8, 9]
    assert [tree.depth(uid) for uid in (0, 2, 3, 5)] == [0, 1, 2, 3]
    assert [child.uid for child in tree.children(2)] == [3, 6]


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([], "at least one node"),
        ([DescribedNode(1, "a", "A", None), DescribedNode(1, "b", "B", 1)], "uid 1 of 'b' is used twice"),
        ([DescribedNode(1, "a", "A", None), DescribedNode(2, "b", "B", None)], "no other, should have no parent"),
        ([DescribedNode(1, "a", "A", None), DescribedNode(2, "b", "B", 7)], "'b' has parent 7"),
    ],
)
def test_an_inconsistent_tree_is_refused_with_the_node_that_is_wrong(nodes, words):
    with pytest.raises(VisualizationError, match=words):
        TreeDescription(nodes)


def test_an_unknown_uid_is_an_error_that_names_the_tree(fetch_nodes):
    with pytest.raises(VisualizationError, match="'fetch' has no node with uid 77"):
        TreeDescription(fetch_nodes).node(77)
