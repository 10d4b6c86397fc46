"""Ports as typed attributes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
from annotated_types import Gt

from bestman_bt.engine import (
    SUCCESS,
    BlackboardError,
    EngineError,
    In,
    InOut,
    NodeError,
    NodeRegistry,
    Out,
    SyncAction,
    TreeLoadError,
    build_tree,
    load_tree,
    palette_xml,
)

TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><{leaf}/></BehaviorTree></root>'


class Count(SyncAction):
    """Adds ``step`` to the entry, ``times`` times."""

    step = In[float](Annotated[float, Gt(0)], "what to add", default=1.0)
    times = In(int, "how often", default=2, required=True)
    label = In(str, "what for", required=False)
    count = InOut(float, "the entry", required=False)
    name_ = Out(str, "the label", port="name_of_it")

    def on_tick(self) -> int:
        self.count = (self.count or 0.0) + self.step * self.times
        self.name_ = self.label or "none"
        return SUCCESS


def loaded(leaf: str):
    registry = NodeRegistry()
    registry.register(Count)
    return load_tree(TREE.format(leaf=leaf), registry)


def test_attributes_read_and_write_the_entries_that_ports_are_mapped_to() -> None:
    tree = loaded('Count step="1.5" times="{n}" count="{sum}" name_of_it="{label}"')
    tree.blackboard["n"] = 3
    tree.tick_once()
    tree.tick_once()
    assert (tree.blackboard["sum"], tree.blackboard["label"]) == (9.0, "none")


def test_an_optional_port_is_none_and_a_default_is_taken() -> None:
    tree = loaded("Count")
    (node,) = tree.nodes
    assert isinstance(node, Count)
    assert (node.step, node.times, node.label, node.count) == (1.0, 2, None, None)


def test_the_port_has_type_bounds_description_and_direction() -> None:
    registry = NodeRegistry()
    info = registry.info_of_class(registry.register(Count))
    described = {p.name: (p.direction, p.type_name, p.required, p.default, p.description) for p in info.ports.values()}
    assert described == {
        "step": ("input", "float", False, 1.0, "what to add"),
        "times": ("input", "int", False, 2, "how often"),
        "label": ("input", "str", False, None, "what for"),
        "count": ("inout", "float", False, None, "the entry"),
        "name_of_it": ("output", "str", False, None, "the label"),
    }
    assert '<input_port name="times" type="int" default="2">how often</input_port>' in palette_xml(registry)
    with pytest.raises(TreeLoadError, match="'step'.*above 0"):
        loaded('Count step="-1"')


def test_an_input_is_not_written_and_an_output_is_not_read() -> None:
    (node,) = loaded("Count").nodes
    with pytest.raises(AttributeError, match=r"Count\.step is an input port"):
        node.step = 2.0
    with pytest.raises(AttributeError, match=r"Count\.name_of_it is an output port"):
        _ = node.name_


def test_an_entry_takes_the_type_of_the_port() -> None:
    tree = loaded('Count times="{n}"')
    with pytest.raises(BlackboardError, match="'n' is locked to int"):
        tree.blackboard["n"] = "many"
    with pytest.raises(NodeError, match="port 'times'.*no value"):
        tree.tick_once()


@pytest.mark.parametrize(("attribute", "base"), [("name", "Behaviour|Node"), ("parent", "Node"), ("status", r"\w+")])
def test_a_port_that_would_hide_an_attribute_is_refused_when_the_class_is_made(attribute: str, base: str) -> None:
    with pytest.raises(
        EngineError, match=rf"'{attribute}' of Wrong would hide ({base})\.{attribute}.*port='{attribute}'"
    ):
        type("Wrong", (SyncAction,), {attribute: In(str)})


def test_a_default_may_name_an_entry_whatever_the_type() -> None:
    class Follow(SyncAction):
        """Doubles the entry."""

        given = In(float, "what to double", default="{length}")
        twice = Out(float, "the double", default="{double}")

        def on_tick(self) -> int:
            self.twice = 2.0 * self.given
            return SUCCESS

    tree = build_tree(Follow())
    tree.blackboard["length"] = 1.5
    tree.tick_once()
    assert tree.blackboard["double"] == 3.0


def test_a_subclass_may_narrow_a_port_and_keeps_the_others() -> None:
    class Few(Count):
        times = In(int, "once", default=1)

    info = NodeRegistry().info_of_class(Few)
    assert (info.ports["times"].default, info.ports["step"].default) == (1, 1.0)


@pytest.mark.slow
def test_mypy_knows_the_types_of_ports(tmp_path: Path) -> None:
    script = tmp_path / "leaf.py"
    script.write_text(
        "from bestman_bt.engine import In, Out, SUCCESS, SyncAction\n"
        "from bestman_bt.messages import Pose2D\n\n\n"
        "class Turn(SyncAction):\n"
        "    goal = In(Pose2D, 'where')\n"
        "    speed = In(float, 'm/s', required=False)\n"
        "    angle = Out(float, 'rad')\n\n"
        "    def on_tick(self) -> int:\n"
        "        self.angle = self.goal.theta\n"
        "        self.angle = self.goal\n"
        "        print(self.goal.heading, self.speed + 1.0)\n"
        "        return SUCCESS\n"
    )
    ran = subprocess.run([sys.executable, "-m", "mypy", str(script)], capture_output=True, text=True, check=False)
    wrong = [line.split(": error: ")[1] for line in ran.stdout.splitlines() if ": error: " in line]
    assert len(wrong) == 3, ran.stdout
    assert "Incompatible types in assignment" in wrong[0]
    assert '"Pose2D" has no attribute "heading"' in wrong[1]
    assert "Unsupported operand types" in wrong[2] or "Unsupported left operand" in wrong[2]
