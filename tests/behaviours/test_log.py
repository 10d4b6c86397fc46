"""A line of the tree itself."""

from __future__ import annotations

import pytest

from behaviours.log import Log
from bestman_bt.engine import SUCCESS, NodeRegistry, load_tree


def test_a_log_line_holds_values_of_its_own_blackboard(caplog: pytest.LogCaptureFixture) -> None:
    registry = NodeRegistry()
    registry.register(Log)
    tree = load_tree(
        """<root BTCPP_format="4" main_tree_to_execute="Main">
        <BehaviorTree ID="Main"><Sequence>
          <Script code="object := 'cup'; count := 3; inner := 'outside'"/>
          <Log text="{object} and {count}"/><Log text="{count}"/><Log text="the {object} is on {where}"/>
          <SubTree ID="Inner" thing="{object}"/>
        </Sequence></BehaviorTree>
        <BehaviorTree ID="Inner"><Log text="{thing}, {inner}, {@count}"/></BehaviorTree></root>""",
        registry,
    )
    with caplog.at_level("INFO", logger="behaviours"):
        assert tree.tick_once() == SUCCESS
    said = ["cup and 3", "3", "the cup is on {where}", "cup, {inner}, 3"]
    assert [record.getMessage() for record in caplog.records] == said
    assert [node.feedback_message for node in tree.nodes if node.type_id == "Log"] == said
