"""A stop that a person asks for, at many moments of a tree that clears stops and commands again as fast as it can."""

from __future__ import annotations

import os
import threading
import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import pytest

from bestman_bt.control.robot_stop import HELD, RobotStop
from bestman_bt.engine import FAILURE, SUCCESS, NodeRegistry, SyncAction, WallClock, load_tree
from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Executor, TerminationReason
from bestman_bt.runtime.telemetry import Telemetry
from hal.api import CommandRefusedError, Failure, MotionErrorCode
from hal.parts.stop_latch import StopLatch

RECOVERING = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Repeat num_cycles="-1"><Fallback>
    <Sequence><Command/><Command/><Trip/></Sequence>
    <Sequence><Clear/><Command/></Sequence>
  </Fallback></Repeat>
</BehaviorTree></root>"""


class Machine:
    """As much of a robot as a stop needs; clearing takes a moment, as with a real controller."""

    def __init__(self) -> None:
        self.latch = StopLatch()
        self.lock = threading.Lock()
        self.commanded: list[float] = []
        self.clears = 0

    @property
    def stopped(self) -> bool:
        return bool(self.latch)

    def stop(self) -> None:
        with self.lock:
            self.latch.set()

    def clear_stop(self) -> None:
        time.sleep(0.0003)
        self.latch.clear()
        self.clears += 1

    def command(self) -> None:
        with self.lock:
            self.latch.check("arm", "command")
            self.commanded.append(time.perf_counter())


class OnMachine(SyncAction, ABC):
    """Notes when it begins."""

    @abstractmethod
    def act(self, machine: Machine, stop: RobotStop) -> bool: ...

    def on_tick(self) -> int:
        machine, stop, begun = self.context
        begun.append(time.perf_counter())
        return SUCCESS if self.act(machine, stop) else FAILURE


class Command(OnMachine):
    def act(self, machine: Machine, stop: RobotStop) -> bool:
        try:
            machine.command()
        except CommandRefusedError:
            return False
        return True


class Trip(OnMachine):
    """The controller stops by itself."""

    def act(self, machine: Machine, stop: RobotStop) -> bool:
        machine.latch.set(Failure(MotionErrorCode.COLLISION, "a collision"))
        return False


class Clear(OnMachine):
    def act(self, machine: Machine, stop: RobotStop) -> bool:
        return not stop.clear()


@pytest.fixture
def pauses() -> list[float]:
    generator = np.random.default_rng(3)
    return list(generator.uniform(0.0, 0.004, 150))


@pytest.mark.parametrize("listening", [False, True])
def test_no_leaf_begins_nothing_is_cleared_and_no_command_accepted_after_it(
    pauses: list[float], listening: bool
) -> None:
    registry = NodeRegistry()
    for node in (Command, Trip, Clear):
        registry.register(node)
    cleared = 0
    for pause in pauses:
        machine = Machine()
        stop, begun = RobotStop(machine), list[float]()
        tree = load_tree(RECOVERING, registry, context=(machine, stop, begun), clock=WallClock())
        if listening:
            tree.subscribe(lambda changes: None)
        executor = Executor(tree, tree.clock, period=0.0)
        run = RunEvent("recovering", "recovering", "", "", 0, "", os.getpid(), time.time(), 1000.0, "real")
        channel = ControlChannel(executor, stop.hold, Telemetry(executor, run))
        ended: list[Any] = []
        thread = threading.Thread(target=lambda run=executor.run, to=ended: to.append(run()))
        thread.start()
        time.sleep(pause)
        channel.answer({"do": "stop"})
        answered = time.perf_counter()
        thread.join(60.0)
        assert ended[0].ending is TerminationReason.CANCELLED
        assert ended[0].why == "stopped through the control channel"
        assert machine.stopped
        assert not [moment for moment in machine.commanded if moment > answered]
        assert len([moment for moment in begun if moment > answered]) <= 1  # one may have been on the way to its clock
        assert stop.clear() == HELD
        cleared += machine.clears > 0
    assert cleared > len(pauses) / 4  # the trees did recover from stops that nobody asked for


def test_a_stop_in_the_middle_of_clearing_stays() -> None:
    class Slow(Machine):
        def clear_stop(self) -> None:
            stop.hold()
            super().clear_stop()

    machine = Slow()
    stop = RobotStop(machine)
    machine.stop()
    assert stop.clear() == HELD
    assert machine.stopped
