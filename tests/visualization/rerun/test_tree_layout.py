from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bestman_bt.visualization.rerun.tree_graph import LabelSizes, tidy_layout
from tests.visualization.conftest import nodes_of, tree_of

BUSY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
"""On a machine that is busy with other work, drawing a tree takes as long as hypothesis allows for a slow strategy."""


@st.composite
def trees(draw):
    parents = [draw(st.integers(1, uid - 1)) for uid in range(2, draw(st.integers(2, 41)))]
    names = [draw(st.text("abcdefgh ", min_size=1, max_size=24)) for _ in range(len(parents) + 1)]
    named = zip((None, *parents), names, strict=True)
    return nodes_of(tree_of(*((parent, name, "Sequence") for parent, name in named)))


def laid_out(tree):
    labels = {node.uid: node.name for node in tree}
    return labels, tidy_layout(tree, labels)


@pytest.mark.slow
@BUSY
@given(trees())
def test_no_two_labels_overlap(tree):
    sizes = LabelSizes()
    labels, layout = laid_out(tree)
    boxes = [(*layout.centers[uid], sizes.width(text) / 2) for uid, text in labels.items()]
    for i, (x, y, half) in enumerate(boxes):
        for other_x, other_y, other_half in boxes[:i]:
            assert abs(x - other_x) >= half + other_half or abs(y - other_y) >= sizes.row_height - 1e-6


@pytest.mark.slow
@BUSY
@given(trees())
def test_parents_stand_left_of_and_midway_between_their_outer_children(tree):
    _, layout = laid_out(tree)
    for node in tree:
        children = [layout.centers[child.uid] for child in tree.children(node.uid)]
        if len(children) > 1:
            x, y = layout.centers[node.uid]
            assert abs(y - (children[0][1] + children[-1][1]) / 2) < 1e-6
            assert all(x < child_x for child_x, _ in children)
            assert [child_y for _, child_y in children] == sorted(child_y for _, child_y in children)


def test_an_only_child_stands_right_below_its_parent_in_the_same_column():
    chain = tree_of((None, "retry", "Retry"), (1, "retry", "Retry"), (2, "left", "Leaf"), (2, "right", "Leaf"))
    _, layout = laid_out(nodes_of(chain))
    sizes = LabelSizes()
    dx, dy = (b - a for a, b in zip(layout.centers[1], layout.centers[2], strict=True))
    assert (dx, dy) == (sizes.chain_indent, sizes.row_height)


@BUSY
@given(trees())
def test_everything_lies_within_the_stated_size(tree):
    labels, layout = laid_out(tree)
    sizes = LabelSizes()
    for uid, text in labels.items():
        x, y = layout.centers[uid]
        half = sizes.width(text) / 2
        assert half - 1e-6 <= x <= layout.size[0] - half + 1e-6
        assert sizes.row_height / 2 - 1e-6 <= y <= layout.size[1] - sizes.row_height / 2 + 1e-6


def test_a_shallow_leaf_uses_the_gap_beside_a_deep_subtree():
    deep = [(None, "root", "Sequence"), (1, "deep", "Sequence"), *[(2, "leaf", "Leaf")] * 5, (1, "shallow", "Leaf")]
    _, layout = laid_out(nodes_of(tree_of(*deep)))
    assert layout.size[1] == 5 * LabelSizes().row_height
