from __future__ import annotations

from dataclasses import replace

import pytest

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
    load_tree,
)
from bestman_bt.engine.logs.btlog import LogError
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.xml.writer import full_tree_xml
from bestman_bt.records.described_tree import describe_changes, describe_tree, describe_xml, xml_of
from bestman_bt.records.events import DescribedNode
from bestman_bt.records.history import RunHistory
from bestman_bt.records.palette import appearance_of

TREE = """
<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence name="&lt;b&gt;all&lt;/b&gt;">
      <SubTree ID="Twice" name="first" goal="cup"/>
      <SubTree ID="Twice"/>
      <Inverter><AlwaysFailure/></Inverter>
      <ScriptCondition name="is it?" code="true"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Twice">
    <Sequence><AlwaysSuccess/><SubTree ID="Inner"/></Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Inner"><Sleep name="wait" msec="5"/></BehaviorTree>
</root>
"""


def test_a_log_describes_its_nodes_as_the_executed_tree_does() -> None:
    tree = load_tree(TREE)

    logged, ran = describe_xml(full_tree_xml(tree)), describe_tree(tree)

    assert [replace(node, ports={}, where="") for node in ran.nodes] == [
        replace(node, ports={}) for node in logged.nodes
    ]
    assert logged.id == ran.id == "Main"


def test_the_palette_of_a_log_reports_what_kind_each_node_is() -> None:
    nodes = {node.path: node for node in describe_xml(full_tree_xml(load_tree(TREE))).nodes}

    assert nodes["<b>all</b>"].category == "control"
    assert nodes["first"].category == "subtree"
    assert nodes["first"].type == "Twice"
    assert nodes["first"].ports == {"goal": "cup"}
    assert nodes["is it?"].category == "condition"
    assert nodes["is it?"].is_leaf
    assert not nodes["first"].is_leaf


@pytest.mark.parametrize(
    ("xml", "words"),
    [
        ("<root>", "cannot be read"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><root/>", "entity declarations are refused"),
        ("<root/>", "no main tree"),
        ('<root><BehaviorTree ID="T"><Sequence name="s"/></BehaviorTree></root>', "has the number ''"),
        (
            '<root><BehaviorTree ID="T"><A _uid="1"><B _uid="1"/></A></BehaviorTree></root>',
            "two nodes with the number 1",
        ),
    ],
)
def test_what_is_no_tree_of_a_log_is_refused_in_words(xml: str, words: str) -> None:
    with pytest.raises(LogError, match=words):
        describe_xml(xml)


def test_a_log_whose_tree_contains_itself_has_an_end() -> None:
    xml = (
        '<root><BehaviorTree ID="M"><SubTree ID="T" _fullpath="t" _uid="1"/></BehaviorTree>'
        '<BehaviorTree ID="T" _fullpath="t"><SubTree ID="T" _fullpath="t" _uid="2"/></BehaviorTree></root>'
    )

    assert [node.uid for node in describe_xml(xml).nodes] == [1, 2]


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


def test_changes_of_a_tick_carry_what_the_nodes_say():
    tree = loaded_tree()
    history = RunHistory()
    history.take(describe_tree(tree))
    tree.subscribe(lambda changes: history.take(describe_changes(tree, changes, 0.0, 1)))
    uids = {node.name: node.uid for node in tree.nodes}
    tree.tick_exactly_once()
    now = history.states.now
    assert history.message_at(uids["drop it"], 0.0) == "DROPPED: it fell"
    assert appearance_of(now, uids["drop it"]).word == "failure"
    assert history.message_at(uids["to the sink"], 0.0) == "driving 2.0 m"
    assert now.states[uids["main"]] == RUNNING
    tree.tick_exactly_once()
    assert history.message_at(uids["to the sink"], 0.0) == "arrived"
    assert appearance_of(now, uids["main"]).word == "succeeded"


def test_what_has_no_code_here_is_a_placeholder() -> None:
    tree = open_tree(
        '<root BTCPP_format="4"><BehaviorTree ID="A"><Sequence><Unheard/></Sequence></BehaviorTree></root>'
    )
    assert [node.placeholder for node in describe_tree(tree).nodes] == [False, True]


def test_described_nodes_become_xml_that_describes_the_same() -> None:
    nodes = [
        DescribedNode(1, None, 'all "of" <it>', "Sequence", "control", "", {}, ""),
        DescribedNode(2, 1, "no\x01t", "Inverter", "decorator", "", {}, ""),
        DescribedNode(3, 2, "ask", "Ask", "condition", "", {}, ""),
        DescribedNode(4, 1, "do", "Do", "action", "", {}, ""),
    ]
    told = describe_xml(xml_of(nodes, "Main & more"))
    assert told.id == "Main & more"
    assert [(node.uid, node.parent, node.type, node.category) for node in told.nodes] == [
        (node.uid, node.parent, node.type, node.category) for node in nodes
    ]
    assert [node.name for node in told.nodes] == ['all "of" <it>', "no?t", "ask", "do"]
