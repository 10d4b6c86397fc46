"""The wire to the process that holds a robot's connections: answers belong to their questions."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Iterator

import pytest

from hal.api import NotConnectedError
from hal.hardware.isolated_robot import RpcConnection


@pytest.fixture
def _interruptible() -> Iterator[None]:
    """Tests that are started in the background begin with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_interruptible")
def test_after_an_interrupt_between_question_and_answer_the_next_question_gets_its_own_answer() -> None:
    ours, theirs = multiprocessing.Pipe()
    main, was_interrupted = threading.main_thread().ident, threading.Event()
    assert main is not None

    def serve() -> None:
        question = theirs.recv()
        signal.pthread_kill(main, signal.SIGINT)
        was_interrupted.wait(60.0)
        theirs.send(f"answer to {question}")
        theirs.send(f"answer to {theirs.recv()}")

    wire = RpcConnection(ours)
    server = threading.Thread(target=serve)
    server.start()
    with pytest.raises(KeyboardInterrupt):
        wire.ask("the first")
    was_interrupted.set()
    assert wire.ask("the second") == "answer to the second"
    server.join()
    wire.close()
    with pytest.raises(NotConnectedError):
        wire.ask("the third")
