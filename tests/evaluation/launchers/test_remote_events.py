"""Episodes whose executors this machine does not see: their events come through the driver."""

from __future__ import annotations

import errno
import json
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.launchers import remote_events
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest
from bestman_bt.evaluation.launchers.remote_events import EventReceiver
from bestman_bt.evaluation.launchers.worker_process import WorkerProcess
from bestman_bt.monitor.control_client import ControlError, ask_events, request, running_executors

SLEEPS = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sleep name="rest" msec="60000"/></BehaviorTree></root>'


@pytest.fixture
def receiver() -> Iterator[EventReceiver]:
    made = EventReceiver("127.0.0.1")
    yield made
    made.close()


def seen(worker: WorkerProcess) -> tuple[list[dict[str, Any]], str]:
    """The events that a monitor is told of the one episode that runs, and what the executor answers to a stop."""
    while not (sockets := running_executors()):
        assert worker.answer(0.05) is None
    try:
        request(sockets[0], {"do": "stop"})
        told = "stopped"
    except ControlError as error:
        told = str(error)
    return [json.loads(line) for line in ask_events(sockets[0], ["states"])], told


@pytest.mark.slow
def test_an_episode_on_another_machine_is_seen_here_from_its_tree_to_its_end(
    receiver: EventReceiver, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sleeps.xml").write_text(SLEEPS)
    config = load_run("pick_bench", tree=tmp_path / "sleeps.xml", seed=3)
    with tempfile.TemporaryDirectory() as elsewhere:
        with monkeypatch.context() as patch:
            patch.setenv("XDG_RUNTIME_DIR", elsewhere)
            worker = WorkerProcess()
        worker.give(replace(EpisodeRequest(config), events=receiver.address).pickled(), 300.0)
        events, told = seen(worker)
        while (answer := worker.answer(0.1)) is None:
            pass
        worker.kill()
    assert answer.result
    run, tree = events[:2]
    assert (run["task"], run["seed"], run["folder"]) == ("pick_bench", 3, "")
    assert run["source"].startswith("process ")
    assert [node["name"] for node in tree["nodes"]] == ["rest"]
    assert events[-1]["event"] == "end"
    assert told == "this execution is only watched: 'stop' has to be requested from its own process"


def test_a_client_without_the_key_is_ignored(receiver: EventReceiver) -> None:
    where = (receiver.address.host, receiver.address.port)
    with pytest.raises(AuthenticationError):
        Client(where, authkey=b"guessed")
    Client(where, authkey=receiver.address.key).close()


def test_a_silent_client_blocks_no_other_and_is_not_waited_for(
    receiver: EventReceiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote_events, "HANDSHAKE", 1)
    where, key = (receiver.address.host, receiver.address.port), receiver.address.key
    with Client(where, authkey=key) as known, socket.create_connection(where) as silent:
        Client(where, authkey=key).close()
        while silent.recv(1024):
            pass
        assert not known.poll()  # it is not closed: an episode may be silent


def test_connections_beyond_the_most_are_closed_and_leave_their_place_to_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(remote_events, "MOST_CONNECTIONS", 1)
    receiver = EventReceiver("127.0.0.1")
    where, key = (receiver.address.host, receiver.address.port), receiver.address.key
    with Client(where, authkey=key), pytest.raises((EOFError, ConnectionError)):
        Client(where, authkey=key)
    is_free = False
    while not is_free:
        try:
            Client(where, authkey=key).close()
            is_free = True
        except (EOFError, ConnectionError):
            time.sleep(0.01)
    receiver.close()


def test_without_free_file_descriptors_it_tries_again_and_does_not_spin(monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[float] = []

    def accept(_: socket.socket) -> None:
        tries.append(time.monotonic())
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(socket.socket, "accept", accept)
    receiver = EventReceiver("127.0.0.1")
    while len(tries) < 2:
        time.sleep(0.01)
    receiver.close()
    assert tries[1] - tries[0] >= remote_events.RETRY
