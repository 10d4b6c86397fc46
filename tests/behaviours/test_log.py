"""A line of the tree itself."""

from __future__ import annotations

import pytest

from behaviours.log import Log
from bestman_bt.engine import SUCCESS, NodeRegistry, load_tree
from bestman_bt.messages import Pose2D


def test_a_log_line_holds_values_of_its_own_blackboard(caplog: pytest.LogCaptureFixture) -> None:
    registry = NodeRegistry()
    registry.register(Log)
    registry.register(Log, "Say")
    tree = load_tree(
        """<root BTCPP_format="4" main_tree_to_execute="Main">
        <BehaviorTree ID="Main"><Sequence>
          <Script code="object := 'cup'; count := 3; inner := 'outside'"/>
          <Log text="{object} and {count}"/><Say text="{count}"/><Log text="the {object} is on {where}"/>
          <SubTree ID="Inner" thing="{object}"/>
        </Sequence></BehaviorTree>
        <BehaviorTree ID="Inner"><Log text="{thing}, {inner}, {@count}"/></BehaviorTree></root>""",
        registry,
    )
    with caplog.at_level("INFO", logger="behaviours"):
        assert tree.tick_once() == SUCCESS
    said = ["cup and 3", "3", "the cup is on {where}", "cup, {inner}, 3"]
    assert [record.getMessage() for record in caplog.records] == said
    assert [node.feedback_message for node in tree.nodes if isinstance(node, Log)] == said


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.1 + 0.2, "0.3"),
        (1 / 3, "0.333333"),
        (-1234567.125, "-1234567.125"),
        (3, "3"),
        (5e-17, "0.0"),
        ([0.1 + 0.2, 2.5, 7], "0.3;2.5;7"),
        (Pose2D(0.1 + 0.2, 2.0, -1 / 3), "Pose2D(x=0.3, y=2.0, theta=-0.333333)"),
        ("firmware 1.23456789", "firmware 1.23456789"),
        (True, "true"),
    ],
)
def test_numbers_in_a_log_line_are_rounded_to_six_decimals_and_texts_stay(value: object, said: str) -> None:
    registry = NodeRegistry()
    registry.register(Log)
    registry.register(Log, "Say")
    body = '<Log text="it is {value}"/>'
    tree = load_tree(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>', registry)
    tree.blackboard["value"] = value
    assert tree.tick_once() == SUCCESS
    assert tree.root.feedback_message == f"it is {said}"
