"""Entries that are read before they have a value: told once, where the tree names them outermost."""

from __future__ import annotations

from pathlib import Path

import py_trees
import pytest

from bestman_bt.engine import SUCCESS, NodeRegistry, PortInformation, Sequence, SyncAction, build_tree, load_tree
from bestman_bt.engine.unwritten import may_write_undeclared, unwritten_reads
from bestman_bt.engine.validation import validate_file


class Grasp(SyncAction):
    INPUT_PORTS = {"target": PortInformation(str), "hint": PortInformation(str, required=False)}
    OUTPUT_PORTS = {"told": PortInformation(str, required=False, default_value="{told}")}

    def on_tick(self) -> int:
        return SUCCESS


class Unseen(SyncAction):
    def on_tick(self) -> int:
        self.board.set("thing", "cup")
        return SUCCESS


@pytest.fixture
def registry() -> NodeRegistry:
    registry = NodeRegistry()
    registry.register(Grasp)
    registry.register(Unseen)
    return registry


def told(body: str, registry: NodeRegistry, more: str = "", given: tuple[str, ...] = ()) -> list[str]:
    text = f'<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">\n{body}</BehaviorTree>{more}</root>'
    reads = unwritten_reads(load_tree(text, registry), given)
    return [str(read.problem("error" if read.fails else "warning")) for read in reads]


TAKE = (
    '<BehaviorTree ID="Take"><Sequence><Grasp target="{object}"/><Grasp target="{object}"/></Sequence></BehaviorTree>'
)


def test_a_misspelt_key_in_a_subtrees_port_is_reported_once_in_the_subtrees_line(registry: NodeRegistry) -> None:
    body = '<Sequence>\n<Script code="thing := \'cup\'"/>\n<SubTree ID="Take" object="{thnig}"/></Sequence>'
    assert told(body, registry, TAKE) == [
        "<text>:4: <SubTree> port 'object': reads '{thnig}', which nothing in the tree writes (did you mean '{thing}'?)"
    ]


def test_through_two_subtrees_the_outermost_line_is_reported(registry: NodeRegistry) -> None:
    middle = '<BehaviorTree ID="Twice"><SubTree ID="Take" object="{what}"/></BehaviorTree>'
    (message,) = told('<SubTree ID="Twice" what="{thing}"/>', registry, middle + TAKE)
    assert message.startswith("<text>:2: <SubTree> port 'what': reads '{thing}'")
    assert told('<SubTree ID="Twice" what="{thing}"/>', registry, middle + TAKE, given=("thing",)) == []
    assert told('<SubTree ID="Twice" what="cup"/>', registry, middle + TAKE) == []


def test_a_port_that_a_subtree_of_another_file_lacks_is_reported_once_at_the_subtree(
    registry: NodeRegistry, tmp_path: Path
) -> None:
    (tmp_path / "abilities.xml").write_text(
        f'<root BTCPP_format="4">{TAKE}'
        '<BehaviorTree ID="Twice"><SubTree ID="Take" object="{object}"/></BehaviorTree></root>'
    )
    tree = tmp_path / "tree.xml"
    tree.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="M"><include path="abilities.xml"/>'
        '<BehaviorTree ID="M"><Sequence>\n'
        '<SubTree ID="Twice" objekt="cup"/>\n<SubTree ID="Twice"/>\n<SubTree ID="Take" _autoremap="true"/>\n'
        '<SubTree ID="Take" object="cup" quick="true"/></Sequence></BehaviorTree></root>'
    )
    why = "<SubTree> port 'object': it is not given, and the tree 'Twice' reads it"
    reads = unwritten_reads(load_tree(tree, registry))
    assert [str(read.problem("error")).removeprefix(f"{tmp_path}/") for read in reads] == [
        f"tree.xml:2: {why} (did you mean 'objekt'?)",
        f'tree.xml:3: {why} (give object="…")',
        f'tree.xml:4: {why.replace("Twice", "Take")} (give object="…")',
    ]
    unread = [str(one) for one in validate_file(tree, registry) if "uses it" in one.message]
    assert [one.removeprefix(f"{tmp_path}/") for one in unread] == [
        "tree.xml:2: warning: <SubTree> port 'objekt': nothing in the tree 'Twice' uses it (did you mean 'object'?)",
        "tree.xml:5: warning: <SubTree> port 'quick': nothing in the tree 'Take' uses it",
    ]


def test_a_port_that_may_be_empty_is_a_warning(registry: NodeRegistry) -> None:
    (message,) = told('<Grasp target="cup" hint="{hint}"/>', registry)
    assert ": warning: <Grasp> port 'hint'" in message


@pytest.mark.parametrize(
    "writer",
    [
        "<Script code=\"x := 'cup'\"/>",
        '<SetBlackboard value="cup" output_key="x"/>',
        '<Grasp target="cup" told="{x}"/>',
        "<AlwaysSuccess _onSuccess=\"x := 'cup'\"/>",
    ],
)
def test_what_is_written_only_afterwards_is_reported_with_the_line_of_the_writer(
    writer: str, registry: NodeRegistry
) -> None:
    reader = '<Grasp target="{x}"/>'
    assert told(f"<Sequence>{writer}{reader}</Sequence>", registry) == []
    (message,) = told(f"<Sequence>{reader}\n{writer}</Sequence>", registry)
    assert message == "<text>:2: <Grasp> port 'target': reads '{x}', which is written only later, in line 3"


@pytest.mark.parametrize("around", ["RetryUntilSuccessful num_attempts='2'", "Repeat num_cycles='2'"])
def test_in_a_loop_the_writer_may_have_been_ticked_before(around: str, registry: NodeRegistry) -> None:
    inner = "<Fallback><Grasp target='{x}'/><Script code=\"x := 'cup'\"/></Fallback>"
    assert told(f"<{around}>{inner}</{around.split()[0]}>", registry) == []
    assert told(f"<ReactiveFallback><AlwaysFailure/>{inner}</ReactiveFallback>", registry) == []


def test_an_output_that_is_written_by_default_counts(registry: NodeRegistry) -> None:
    assert told('<Sequence><Grasp target="cup"/><Grasp target="{told}"/></Sequence>', registry) == []


def test_code_that_asks_for_its_blackboard_may_write_what_its_ports_do_not_name(registry: NodeRegistry) -> None:
    native = py_trees.behaviours.SetBlackboardVariable("set", "thing", "cup", overwrite=True)
    tree = build_tree(Sequence([Grasp(target="cup"), Unseen(), native, py_trees.behaviours.Success("fine")]))
    assert [may_write_undeclared(node) for node in tree.nodes] == [False, False, True, True, False]
