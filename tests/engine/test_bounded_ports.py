"""Ports may say what they accept beyond their type."""

from __future__ import annotations

from typing import Annotated

import pytest
from annotated_types import Ge, Gt, Interval, Lt

from bestman_bt.engine import (
    SUCCESS,
    BoundedPort,
    ManualClock,
    NodeError,
    NodeRegistry,
    OneOf,
    SyncAction,
    TreeLoadError,
    build_tree,
    load_tree,
)

COLOURS = ["red", "green"]


class Paint(SyncAction):
    INPUT_PORTS = {
        "share": BoundedPort(Annotated[float, Interval(ge=0, le=1)], required=False, default_value=0.5),
        "coats": BoundedPort(Annotated[int, Ge(1)], required=False, default_value=1),
        "width": BoundedPort(float, required=False, default_value=1.0, description="metres"),
        "colour": BoundedPort(Annotated[str, OneOf(lambda: COLOURS)], required=False, default_value="red"),
    }

    def on_tick(self) -> int:
        self.read = [self.get_input(port) for port in self.INPUT_PORTS]
        return SUCCESS


def loaded(ports: str):
    registry = NodeRegistry()
    registry.register(Paint)
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M"><Paint name="it" {ports}/></BehaviorTree></root>'
    return load_tree(text, registry, clock=ManualClock())


def test_literals_within_the_bounds_are_read_as_their_type() -> None:
    tree = loaded('share="1" coats="2" width="-3" colour="green"')
    assert tree.tick_exactly_once() == SUCCESS
    assert tree.node("it").read == [1.0, 2, -3.0, "green"]


def test_every_literal_out_of_bounds_is_reported_at_once() -> None:
    with pytest.raises(TreeLoadError) as refused:
        loaded('share="1.5" coats="0" width="inf" colour="gren"')
    assert [(problem.field, problem.message) for problem in refused.value.problems] == [
        ("share", "1.5 is not accepted, but a finite number from 0 to 1"),
        ("coats", "0 is not accepted, but a whole number of 1 or more"),
        ("width", "inf is not accepted, but a finite number (metres)"),
        ("colour", "there is no 'gren'; did you mean 'green'? (known: 'green', 'red')"),
    ]


def test_a_literal_with_a_unit_is_refused_and_the_unit_of_the_port_told() -> None:
    with pytest.raises(TreeLoadError, match=r"'50cm' is not accepted: give a number alone, without a unit \(metres\)"):
        loaded('width="50cm"')


def test_a_tree_made_in_python_is_held_to_the_same_bounds() -> None:
    with pytest.raises(TreeLoadError, match=r"2.0 is not accepted"):
        build_tree(Paint(share=2.0))


def test_an_entry_out_of_bounds_is_an_error_of_the_node_that_reads_it() -> None:
    tree = loaded('share="{share}"')
    tree.blackboard["share"] = 0.25
    assert tree.tick_exactly_once() == SUCCESS
    tree.blackboard["share"] = 2.0
    with pytest.raises(NodeError, match=r"port 'share': 2.0 is not accepted"):
        tree.tick_exactly_once()


def test_names_that_are_registered_later_count(monkeypatch) -> None:
    monkeypatch.setitem(globals(), "COLOURS", [*COLOURS, "blue"])
    assert loaded('colour="blue"').tick_exactly_once() == SUCCESS


def test_a_default_out_of_bounds_is_a_mistake_of_the_declaration() -> None:
    with pytest.raises(ValueError, match=r"0.0 is not accepted, but a finite number above 0 and below 1"):
        BoundedPort(Annotated[float, Gt(0), Lt(1)], required=False, default_value=0.0)
