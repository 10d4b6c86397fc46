"""``--groot2-port``: what is told before anything starts, and that a run's tree is served."""

from __future__ import annotations

import socket
import sys
from types import SimpleNamespace

import pytest

from bestman_bt.cli.run_command import Groot2View
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import RUNNING, load_tree
from tests.monitor.groot2.wire_client import groot2_client, hook
from tests.rigs.free_port import free_port

XML = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sleep name="nap" msec="60000"/></BehaviorTree></root>'


@pytest.mark.parametrize("taken", [0, 1])
def test_a_port_that_is_taken_is_reported_before_anything_starts(taken: int) -> None:
    port = free_port()
    with socket.socket() as other:
        other.bind(("127.0.0.1", port + taken))
        other.listen()
        with pytest.raises(ConfigurationError, match=rf"--groot2-port {port}.*:{port + taken}"), Groot2View(port):
            pass


@pytest.mark.parametrize("missing", ["zmq", "msgpack"])
def test_without_the_extra_it_is_named(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ConfigurationError, match=r"pip install .*\[groot2\]"), Groot2View(free_port()):
        pass


def test_the_tree_of_a_run_is_served_until_the_run_ends(capsys: pytest.CaptureFixture[str]) -> None:
    port, tree = free_port(), load_tree(XML)
    by_hand: list[str] = []
    with Groot2View(port) as view, groot2_client(port) as client:
        after_tick = view.watch(SimpleNamespace(intervened=by_hand.append), tree)
        tree.tick_exactly_once()
        after_tick()
        assert client.states() == {1: RUNNING}
        client.ask("I", hook(1, 1, "FAILURE", once=True))
        tree.tick_exactly_once()
    assert by_hand == ["nap was forced to return FAILURE"]
    assert str(port) in capsys.readouterr().err
    with socket.socket() as free:
        free.bind(("127.0.0.1", port))
