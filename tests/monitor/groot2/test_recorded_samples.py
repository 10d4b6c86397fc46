"""Requests that a BehaviorTree.CPP 4.10 publisher was asked, and what it answered, byte by byte."""

from __future__ import annotations

import json
import struct
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import (
    RUNNING,
    SUCCESS,
    ManualClock,
    NodeRegistry,
    PortInformation,
    StatefulAction,
    Tree,
    load_tree,
)
from bestman_bt.monitor.groot2.publisher import Groot2Publisher
from tests.monitor.groot2.wire_client import Groot2Client, groot2_client
from tests.rigs.free_port import free_port

DATA = Path(__file__).parent / "data"
SAMPLES: dict[str, Any] = json.loads((DATA / "samples.json").read_text())
FULL_TREE = (DATA / "fulltree.xml").read_text()
UUID = slice(6, 22)
TICK = 0.05


class Run3(StatefulAction):
    """Runs for ``n`` ticks, then tells 2.5."""

    INPUT_PORTS = {"n": PortInformation(data_type=int)}
    OUTPUT_PORTS = {"out": PortInformation(data_type=float, required=False)}

    left = 0

    def on_start(self) -> int:
        self.left = int(self.get_input("n"))
        return RUNNING

    def on_running(self) -> int:
        self.left -= 1
        if self.left:
            return RUNNING
        if "out" in self.attributes:
            self.set_output("out", 2.5)
        return SUCCESS


@pytest.fixture
def tree() -> Tree:
    registry = NodeRegistry()
    registry.register(Run3)
    root = ElementTree.fromstring(FULL_TREE)
    root.set("main_tree_to_execute", "Main")
    root.remove(root.findall("TreeNodesModel")[0])
    for element in root.iter():
        element.attrib.pop("_uid", None)
        path = element.attrib.pop("_fullpath", "")
        if element.tag == "SubTree":
            element.set("name", path)
    return load_tree(ElementTree.tostring(root, encoding="unicode"), registry=registry, clock=ManualClock())


@pytest.fixture
def client(tree: Tree) -> Iterator[Groot2Client]:
    port = free_port()
    with Groot2Publisher(tree, port), groot2_client(port) as asking:
        yield asking


def tick(tree: Tree, times: int = 1) -> None:
    for _ in range(times):
        tree.tick_exactly_once()
        tree.clock.sleep(TICK)


def asked(client: Groot2Client, sample: str) -> tuple[list[bytes], list[bytes]]:
    """What is answered, and what the sample has; the UUID of the tree, which is ours, is taken out of both."""
    recorded = SAMPLES[sample]
    answered = client.send(*(bytes.fromhex(part) for part in recorded["request"]))
    expected = [bytes.fromhex(part) for part in recorded["reply"]]
    if answered[0] != b"error":
        answered[0] = answered[0][: UUID.start]
        expected[0] = expected[0][: UUID.start]
    return answered, expected


def tree_elements(xml: str) -> list[tuple[str, dict[str, str]]]:
    root = ElementTree.fromstring(xml)
    return [(e.tag, dict(e.attrib)) for definition in root.findall("BehaviorTree") for e in definition.iter()]


def test_the_full_tree_has_the_recorded_nodes_numbers_and_paths(client: Groot2Client) -> None:
    answered, expected = asked(client, "FULLTREE")
    assert answered[0] == expected[0]
    assert tree_elements(answered[1].decode()) == tree_elements(expected[1].decode())


def test_the_reply_names_one_tree_by_a_uuid_of_version_4(client: Groot2Client) -> None:
    first, second = client.ask("S")[0][UUID], client.ask("T")[0][UUID]
    assert first == second
    assert len(first) == 16
    assert first[6] >> 4 == 4
    assert first[8] >> 6 == 2


def test_states_are_reported_byte_for_byte(tree: Tree, client: Groot2Client) -> None:
    tick(tree, 30)  # as often as needed: every node has been idle, and the first action runs
    while (tree.nodes[2].state, tree.nodes[3].state) != (RUNNING, 0):
        tick(tree)
    answered, expected = asked(client, "STATUS")
    assert answered == expected


def test_blackboards_are_reported_byte_for_byte(tree: Tree, client: Groot2Client) -> None:
    tick(tree, 30)
    answered, expected = asked(client, "BLACKBOARD")
    assert answered == expected


def test_a_recording_has_the_recorded_changes_in_the_recorded_order(tree: Tree, client: Groot2Client) -> None:
    content = bytes.fromhex(SAMPLES["GET_TRANSITIONS"]["reply"][1])
    recorded = [struct.unpack_from("<HB", content, at + 6) for at in range(0, len(content), 9)]
    while (tree.nodes[2].state, tree.nodes[2].left) != (RUNNING, 1):  # type: ignore[attr-defined]
        tick(tree)
    answered, expected = asked(client, "RECORD_start")
    assert answered[0] == expected[0]
    assert len(answered[1]) == len(expected[1])
    tick(tree, 12)
    changes = client.transitions()
    assert [(uid, state) for _, uid, state in changes][: len(recorded)] == recorded
    assert [time for time, _, _ in changes[:6]] == [0, 0, 0, 0, 0, round(2 * TICK * 1e6)]
    assert client.transitions() == []
    assert asked(client, "RECORD_stop")[0] == asked(client, "RECORD_stop")[1]
    tick(tree, 3)
    assert client.transitions() == []


def test_hooks_act_and_answer_byte_for_byte(tree: Tree, client: Groot2Client) -> None:
    while (tree.nodes[2].state, client.states()[7]) != (RUNNING, 10 + SUCCESS):
        tick(tree)
    assert_same(client, "HOOK_INSERT", "HOOKS_DUMP")
    ticking = threading.Thread(target=tick, args=(tree,))
    ticking.start()
    assert_told(client.breakpoint())
    assert_same(client, "STATUS_at_breakpoint", "BREAKPOINT_UNLOCK")
    ticking.join(60.0)
    assert not ticking.is_alive()
    assert_same(client, "HOOK_INSERT_replace")
    tick(tree)
    assert_same(client, "STATUS_after_replace", "HOOK_REMOVE", "HOOK_REMOVE_again", "REMOVE_ALL_HOOKS")


def assert_same(client: Groot2Client, *samples: str) -> None:
    for sample in samples:
        answered, expected = asked(client, sample)
        assert answered == expected, sample


def assert_told(message: list[bytes]) -> None:
    """A breakpoint was reached; the id is any."""
    recorded = [bytes.fromhex(part) for part in SAMPLES["BREAKPOINT_REACHED(pub)"]["message"]]
    assert [message[0][:2], message[1]] == [recorded[0][:2], recorded[1]]


@pytest.mark.parametrize("sample", ["HOOK_REMOVE_again", "REMOVE_ALL_HOOKS", "DISABLE_ALL_HOOKS"])
def test_requests_about_hooks_without_any_answer_byte_for_byte(sample: str, client: Groot2Client) -> None:
    answered, expected = asked(client, sample)
    assert answered == expected


@pytest.mark.parametrize("sample", ["BLACKBOARD_unknown", "BLACKBOARD_missing_part", "UNKNOWN", "BAD_HEADER"])
def test_wrong_requests_are_answered_byte_for_byte(sample: str, client: Groot2Client) -> None:
    answered, expected = asked(client, sample)
    assert answered == expected
