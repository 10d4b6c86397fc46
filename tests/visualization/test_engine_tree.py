from __future__ import annotations

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    Fallback,
    ManualClock,
    Sequence,
    StatefulAction,
    SyncAction,
    build_tree,
)
from bestman_bt.visualization import TreeDescription, describe_changes, describe_tree
from bestman_bt.visualization.node_states import NodeStates


class Drop(SyncAction):
    def on_tick(self) -> int:
        self.feedback_message = "DROPPED: it fell"
        return FAILURE


class Drive(StatefulAction):
    def on_start(self) -> int:
        self.feedback_message = "driving 2.0 m"
        return RUNNING

    def on_running(self) -> int:
        self.feedback_message = "arrived"
        return SUCCESS

    def on_halted(self) -> None:
        pass


def loaded_tree():
    root = Sequence(Fallback(Drop(name="drop it"), Drive(name="to the sink"), name="either"), name="main")
    return build_tree(root, clock=ManualClock())


def test_the_description_of_an_engine_tree_has_its_nodes_in_reading_order():
    tree = loaded_tree()
    described = TreeDescription(describe_tree(tree))
    named = [(node.name, node.type, described.depth(node.uid)) for node in described.depth_first()]
    assert named[-4:] == [
        ("main", "Sequence", named[-4][2]),
        ("either", "Fallback", named[-4][2] + 1),
        ("drop it", "Drop", named[-4][2] + 2),
        ("to the sink", "Drive", named[-4][2] + 2),
    ]


def test_changes_of_a_tick_carry_the_feedback_of_the_leaves():
    tree = loaded_tree()
    states = NodeStates(TreeDescription(describe_tree(tree)))
    tree.subscribe(lambda changes: states.apply(describe_changes(tree, changes)))
    uids = {node.name: node.uid for node in tree.nodes}
    tree.tick_exactly_once()
    assert states.message(uids["drop it"]) == "DROPPED: it fell"
    assert states.look(uids["drop it"]).word == "failure"
    assert states.message(uids["to the sink"]) == "driving 2.0 m"
    assert states.state(uids["main"]) == RUNNING
    tree.tick_exactly_once()
    assert states.message(uids["to the sink"]) == "arrived"
    assert states.look(uids["main"]).word == "succeeded"
