"""The deviations from BehaviorTree.CPP that docs/deviations.md names, one test each."""

from __future__ import annotations

from typing import Annotated

import pytest
from annotated_types import Gt

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    BoundedPort,
    ManualClock,
    NodeError,
    NodeRegistry,
    PortInformation,
    StatefulAction,
    SyncAction,
    TreeLoadError,
    load_tree,
)


class Wait(StatefulAction):
    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return RUNNING

    def on_halted(self) -> None:
        self.halted_at = self.clock.now()


class Show(SyncAction):
    INPUT_PORTS = {"value": PortInformation(int, False)}

    def on_tick(self) -> int:
        return SUCCESS


def tree(body: str, clock: ManualClock | None = None):
    registry = NodeRegistry()
    registry.register(Wait)
    registry.register(Show)
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    return load_tree(text, registry, clock=clock or ManualClock())


def test_a_literal_set_into_an_entry_that_an_untyped_port_declared_is_kept() -> None:
    loaded = tree(
        '<Sequence><SetBlackboard value="hello" output_key="k"/><SetBlackboard value="{k}" output_key="l"/></Sequence>'
    )
    assert loaded.tick_exactly_once() == SUCCESS
    assert loaded.blackboard["l"] == "hello"


def test_double_quoted_strings_are_accepted_in_scripts() -> None:
    loaded = tree("<Script code='a := \"text\"'/>")
    loaded.tick_exactly_once()
    assert loaded.blackboard["a"] == "text"


def test_a_timeout_halts_its_child_at_the_next_tick_and_not_before() -> None:
    clock = ManualClock()
    loaded = tree('<Timeout msec="100"><Wait name="wait"/></Timeout>', clock)
    loaded.tick_exactly_once()
    clock.advance(0.2)
    assert loaded.node("wait").state == RUNNING
    assert loaded.tick_exactly_once() == FAILURE
    assert loaded.node("wait").halted_at == pytest.approx(0.2)


def test_division_by_zero_is_an_error() -> None:
    with pytest.raises(NodeError, match="division by zero"):
        tree('<Script code="a := 1 / 0"/>').tick_exactly_once()


def test_a_required_port_of_an_own_node_is_found_at_load() -> None:
    class Reach(SyncAction):
        INPUT_PORTS = {"goal": PortInformation(str, True)}

    registry = NodeRegistry()
    registry.register(Reach)
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Reach/></BehaviorTree></root>'
    with pytest.raises(TreeLoadError, match="port 'goal': it is required but not given"):
        load_tree(text, registry)


def test_a_default_that_means_the_same_key_is_read_as_such_in_a_subtree_model() -> None:
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence><Script code="x := 3"/>'
        '<SubTree ID="S"/></Sequence></BehaviorTree>'
        '<BehaviorTree ID="S"><ScriptCondition code="x == 3"/></BehaviorTree>'
        '<TreeNodesModel><SubTree ID="S"><input_port name="x" default="{=}"/></SubTree></TreeNodesModel></root>'
    )
    assert load_tree(text).tick_exactly_once() == SUCCESS


def test_an_int_has_64_bits() -> None:
    assert tree('<Show value="2147483648"/>').tick_exactly_once() == SUCCESS
    with pytest.raises(TreeLoadError, match="'9223372036854775808' is not an int"):
        tree('<Show value="9223372036854775808"/>')


def test_files_of_another_format_are_refused() -> None:
    with pytest.raises(TreeLoadError, match="is in the format of BehaviorTree.CPP 3"):
        load_tree('<root BTCPP_format="3"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>')


def test_a_tree_may_have_spaces_in_its_id_and_the_explicit_form_stands_anywhere() -> None:
    text = (
        '<root BTCPP_format="4" main_tree_to_execute="Pick Up"><BehaviorTree ID="Pick Up">'
        '<ReactiveSequence><Action ID="AlwaysSuccess"/></ReactiveSequence></BehaviorTree></root>'
    )
    assert load_tree(text).tick_exactly_once() == SUCCESS


def test_not_a_number_is_refused_as_the_literal_of_a_port_for_numbers() -> None:
    class Wants(SyncAction):
        INPUT_PORTS = {"limit": PortInformation(float), "name": PortInformation(str)}

        def on_tick(self) -> int:
            return SUCCESS

    registry = NodeRegistry()
    registry.register(Wants)
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Wants limit="{}" name="nan"/></BehaviorTree></root>'
    assert load_tree(text.format("1"), registry).nodes
    with pytest.raises(TreeLoadError, match="'nan' is not a number"):
        load_tree(text.format("nan"), registry)


@pytest.mark.parametrize("literal", ["0", "50cm"])
def test_a_literal_out_of_the_bounds_of_a_port_or_with_a_unit_behind_it_is_refused(literal) -> None:
    class Drive(SyncAction):
        INPUT_PORTS = {"distance": BoundedPort(Annotated[float, Gt(0)])}

    registry = NodeRegistry()
    registry.register(Drive)
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Drive distance="{}"/></BehaviorTree></root>'
    assert load_tree(text.format("0.5"), registry).nodes
    with pytest.raises(TreeLoadError, match="port 'distance': .* is not accepted"):
        load_tree(text.format(literal), registry)
