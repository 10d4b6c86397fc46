"""What the author of a leaf can rely on: ports, context, clock, halting, messages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    BlackboardError,
    Condition,
    ManualClock,
    NodeError,
    NodeRegistry,
    PortInformation,
    Sequence,
    StatefulAction,
    SyncAction,
    TreeLoadError,
    build_tree,
    load_tree,
)


@dataclass(frozen=True)
class Pose:
    x: float
    y: float

    @classmethod
    def from_string(cls, text: str) -> Pose:
        x, y = text.split(";")
        return cls(float(x), float(y))

    def to_string(self) -> str:
        return f"{self.x};{self.y}"


class Base(SyncAction):
    INPUT_PORTS = {"target": PortInformation(Pose), "speed": PortInformation(float, False, "m/s", 0.5)}
    OUTPUT_PORTS = {"reached": PortInformation(Pose, False)}


class Drive(Base):
    INPUT_PORTS = {"label": PortInformation(str, False), "count": PortInformation(int, False)}

    def on_tick(self) -> int:
        self.seen = {port: self.get_input(port) for port in ("target", "speed", "label", "count")}
        self.set_output("reached", self.seen["target"])
        return SUCCESS


class Look(SyncAction):
    INPUT_PORTS = {"at": PortInformation(complex)}

    def on_tick(self) -> int:
        self.seen = self.get_input("at")
        return SUCCESS


def drive(**ports: Any) -> Drive:
    return Drive("drive", **ports)


def test_ports_of_base_classes_are_inherited() -> None:
    registry = NodeRegistry()
    registry.register(Drive)
    assert list(registry.info("Drive").ports) == ["target", "speed", "label", "count", "reached"]


def test_a_literal_is_converted_by_the_types_from_string() -> None:
    tree = build_tree(drive(target="1.5;2"))
    tree.tick_exactly_once()
    assert tree.root.seen == {"target": Pose(1.5, 2.0), "speed": 0.5, "label": None, "count": None}


def test_a_converter_serves_nodes_that_were_registered_before_it_and_may_be_replaced() -> None:
    registry = NodeRegistry()
    registry.register(Look)
    tree = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Look at="3 4"/></BehaviorTree></root>'
    with pytest.raises(TreeLoadError, match="a complex cannot be written as a literal"):
        load_tree(tree, registry)
    for scale in (1, 10):
        registry.converters.register(complex, lambda text, scale=scale: complex(*map(int, text.split())) * scale)
        looking = load_tree(tree, registry)
        looking.tick_exactly_once()
        assert looking.root.seen == complex(3, 4) * scale


def test_a_text_on_the_blackboard_is_converted_when_read() -> None:
    tree = build_tree(drive(target="{stand}", count="{n}"))
    tree.blackboard.set("stand", "3;4")
    tree.blackboard.set("n", "7")
    tree.tick_exactly_once()
    assert (tree.root.seen["target"], tree.root.seen["count"]) == (Pose(3.0, 4.0), 7)


def test_an_output_is_written_to_the_entry_it_is_mapped_to() -> None:
    tree = build_tree(drive(target="1;2", reached="{there}"))
    tree.tick_exactly_once()
    assert tree.blackboard["there"] == Pose(1.0, 2.0)


def test_an_output_that_is_not_mapped_is_written_nowhere() -> None:
    tree = build_tree(drive(target="1;2"))
    assert tree.tick_exactly_once() == SUCCESS
    assert tree.blackboard.items() == []


@pytest.mark.parametrize("given", ["there", "{there", "there}", "", "{}"])
def test_an_output_that_is_mapped_to_no_entry_is_refused(given: str) -> None:
    with pytest.raises(TreeLoadError, match="port 'reached': an output port is mapped to an entry"):
        build_tree(drive(target="1;2", reached=given))


def test_an_output_is_converted_to_the_ports_type_and_may_be_nothing() -> None:
    class Tell(SyncAction):
        OUTPUT_PORTS = {"n": PortInformation(int, False), "any": PortInformation(Any, False)}

        def on_tick(self) -> int:
            self.set_output("n", self.context.pop(0))
            self.set_output("any", "7")
            return SUCCESS

    tree = build_tree(Tell(n="{n}", any="{any}"), context=["12", None, 3.5])
    assert tree.tick_exactly_once() == SUCCESS
    assert (tree.blackboard["n"], tree.blackboard["any"]) == (12, "7")
    assert tree.tick_exactly_once() == SUCCESS
    assert tree.blackboard.entry("n").value is None
    with pytest.raises(NodeError, match=r"output port 'n': expected int but got 3\.5"):
        tree.tick_exactly_once()


def test_ports_of_the_other_direction_are_named_as_missing() -> None:
    class Wrong(Drive):
        def on_tick(self) -> int:
            try:
                self.set_output("target", Pose(0, 0))
            except NodeError as error:
                self.context.append(str(error))
            self.get_input("reached")
            return SUCCESS

    told: list[str] = []
    with pytest.raises(NodeError, match="no input port 'reached'"):
        build_tree(Wrong("w", target="1;2"), context=told).tick_exactly_once()
    assert "it has no output port 'target' (its output ports: reached)" in told[0]


def test_equals_sign_maps_a_port_to_the_entry_of_its_name() -> None:
    tree = build_tree(drive(target="{=}"))
    tree.blackboard.set("target", Pose(5, 6))
    tree.tick_exactly_once()
    assert tree.root.seen["target"] == Pose(5, 6)


def test_a_required_port_without_a_value_names_node_port_and_key() -> None:
    tree = build_tree(drive(target="{stand}"))
    with pytest.raises(
        NodeError,
        match=r"node drive \(test_leaves.py:\d+\) \[Drive\]: port 'target': the entry '\{stand\}' has no value",
    ):
        tree.tick_exactly_once()


def test_a_port_locks_its_entry_to_its_type() -> None:
    tree = build_tree(drive(target="1;2", count="{n}"))
    with pytest.raises(BlackboardError, match=r"entry 'n' is locked to int: expected int but got \[1\] \(list\)"):
        tree.blackboard.set("n", [1])


def test_a_value_of_the_wrong_type_in_a_string_entry_is_an_error_that_names_the_type() -> None:
    tree = build_tree(Sequence([drive(target="1;2", label="{n}"), Drive("other", target="1;2", count="{n}")]))
    tree.blackboard.set("n", "many")
    with pytest.raises(
        NodeError, match=r"node other \(test_leaves.py:\d+\) \[Drive\]: port 'count' from '\{n\}': 'many' is not an int"
    ):
        tree.tick_exactly_once()


def test_a_float_that_is_whole_is_taken_for_an_int_and_no_other() -> None:
    tree = build_tree(drive(target="1;2", count="{n}"))
    tree.blackboard.set("n", 3.0)
    tree.tick_exactly_once()
    assert tree.root.seen["count"] == 3
    with pytest.raises(BlackboardError, match="expected int but got 3.5"):
        tree.blackboard.set("n", 3.5)


def test_reading_an_undeclared_port_lists_the_declared_ones() -> None:
    class Wrong(Drive):
        def on_tick(self) -> int:
            self.get_input("goal")
            return SUCCESS

    with pytest.raises(NodeError, match="no input port 'goal' .its input ports: target, speed, label, count"):
        build_tree(Wrong("w", target="1;2")).tick_exactly_once()


def test_an_exception_in_a_leaf_names_the_leaf_and_keeps_its_cause() -> None:
    class Broken(SyncAction):
        def on_tick(self) -> int:
            raise ZeroDivisionError("division by zero")

    from bestman_bt.engine import Inverter, ReactiveSequence

    tree = build_tree(ReactiveSequence([Sequence([Inverter(Broken("bad"))])]))
    with pytest.raises(
        NodeError, match=r"node bad \(test_leaves.py:\d+\) \[Broken\]: ZeroDivisionError: division by zero"
    ) as caught:
        tree.tick_exactly_once()
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("returned", [None, 0, 7, "SUCCESS"])
@pytest.mark.parametrize("logged", [False, True])
def test_a_tick_that_returns_no_status_is_an_error(returned: Any, logged: bool) -> None:
    from bestman_bt.engine import Fallback

    class Odd(Condition):
        def on_tick(self) -> int:
            return returned

    tree = build_tree(Fallback([Odd("odd")]))
    if logged:
        tree.subscribe(lambda changes: None)
    with pytest.raises(NodeError, match="odd .*returned"):
        tree.tick_exactly_once()


def test_a_py_trees_status_is_refused_with_a_hint() -> None:
    import py_trees

    class Odd(SyncAction):
        def on_tick(self) -> Any:
            return py_trees.common.Status.SUCCESS

    with pytest.raises(NodeError, match=r"return bestman_bt\.engine's SUCCESS instead"):
        build_tree(Sequence([Odd()])).tick_exactly_once()


class Timed(StatefulAction):
    def on_load(self) -> None:
        self.calls: list[str] = []

    def on_start(self) -> int:
        self.calls.append("start")
        self.end = self.clock.now() + 1.0
        return RUNNING

    def on_running(self) -> int:
        self.calls.append("running")
        return SUCCESS if self.clock.now() >= self.end else RUNNING

    def on_halted(self) -> None:
        self.calls.append("halted")


def test_a_stateful_action_starts_runs_and_ends_by_the_trees_clock() -> None:
    tree = build_tree(Timed(), clock=ManualClock())
    assert tree.tick_while_running(period=0.4) == SUCCESS
    assert tree.root.calls == ["start", "running", "running", "running"]
    assert tree.clock.now() == pytest.approx(1.2)


def test_a_halt_calls_on_halted_once_and_the_next_tick_starts_anew() -> None:
    tree = build_tree(Timed(), clock=ManualClock())
    tree.tick_exactly_once()
    tree.halt()
    tree.halt()
    tree.tick_exactly_once()
    assert tree.root.calls == ["start", "halted", "start"]


def test_a_leaf_finds_the_context_that_was_handed_over() -> None:
    class Ask(Condition):
        def on_tick(self) -> int:
            return SUCCESS if self.context["ready"] else FAILURE

    assert build_tree(Ask(), context={"ready": True}).tick_exactly_once() == SUCCESS


def test_a_wake_up_ends_the_sleep_of_the_loop() -> None:
    class Waking(StatefulAction):
        def on_start(self) -> int:
            self.wake_up()
            return RUNNING

        def on_running(self) -> int:
            return SUCCESS

    tree = build_tree(Waking(), clock=ManualClock())
    assert tree.tick_while_running(period=10.0) == SUCCESS
    assert tree.clock.now() == 0.0


def test_a_node_outside_a_tree_reports_that_it_has_none() -> None:
    with pytest.raises(NodeError, match="not part of a tree yet"):
        drive(target="1;2").get_input("target")


def test_registering_two_classes_by_one_name_is_refused() -> None:
    from bestman_bt.engine import RegistryError

    registry = NodeRegistry()
    registry.register(Drive)
    with pytest.raises(RegistryError, match="'Drive' is registered already"):
        registry.register(Timed, "Drive")
    with pytest.raises(RegistryError, match="did you mean 'Drive'"):
        registry.info("Driv")


def test_a_class_with_its_own_constructor_is_made_with_its_name() -> None:
    class Counting(SyncAction):
        def __init__(self, name: str) -> None:
            super().__init__(name)
            self.count = 0

        def on_tick(self) -> int:
            self.count += self.get_input("by")
            return SUCCESS

        INPUT_PORTS = {"by": PortInformation(int)}

    registry = NodeRegistry()
    registry.register(Counting)
    tree = load_tree(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Counting name="c" by="2"/></BehaviorTree></root>', registry
    )
    tree.tick_exactly_once()
    tree.tick_exactly_once()
    assert (tree.root.name, tree.root.count) == ("c", 4)


def test_a_synchronous_action_that_returns_running_reports_what_to_do() -> None:
    class Wrong(SyncAction):
        def on_tick(self) -> int:
            return RUNNING

    registry = NodeRegistry()
    registry.register(Wrong)
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><Wrong/></Sequence></BehaviorTree></root>'
    with pytest.raises(NodeError, match="must not return RUNNING; derive it from StatefulAction"):
        load_tree(text, registry).tick_exactly_once()


def test_a_failing_node_is_named_with_file_and_line(tmp_path: Path) -> None:
    file = tmp_path / "drive.xml"
    file.write_text(
        """<root BTCPP_format="4" main_tree_to_execute="Main">
        <BehaviorTree ID="Main"><SubTree ID="Inner" name="inner"/></BehaviorTree>
        <BehaviorTree ID="Inner"><Sequence>
          <AlwaysSuccess/><Sleep msec="{missing}"/>
        </Sequence></BehaviorTree></root>"""
    )
    with pytest.raises(NodeError, match=r"^node Sleep \(drive\.xml:4\) \[Sleep\]: port 'msec'") as caught:
        load_tree(file).tick_once()
    assert caught.value.node == "inner/Sleep::4"
    python = tmp_path / "drive.py"
    python.write_text(
        "from bestman_bt.engine import Sequence, Sleep\n"
        "def build():\n    return Sequence('go', [Sleep(msec='{missing}')])\n"
    )
    assert load_tree(python).nodes[1].where == "Sleep (drive.py:3)"
