"""A controller that cannot tell its clients apart gets one of them at a time, as far as this machine can tell."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path

import pytest

from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.runtime_folder import runtime_folder
from hal.api import Failure
from hal.hardware import connection
from hal.hardware.clock import RealTimeClock
from hal.hardware.connection import Connection, ControllerLock, PartFactory
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch

pytestmark = pytest.mark.real_time

ADDRESS = "192.168.77.203"
HOLDER = f"""
from hal.hardware.connection import ControllerLock
ControllerLock("arm_controller", "xarm", "{ADDRESS}").take()
print("taken", flush=True)
input()
"""


@pytest.fixture(autouse=True)
def own_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of these tests are apart from those of anybody's robots."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(connection, "PATIENCE", 0.3)


def client(driver: str = "xarm", address: str = ADDRESS) -> ControllerLock:
    return ControllerLock("arm_controller", driver, address)


def test_a_second_client_is_refused_until_the_first_one_is_gone() -> None:
    first, second = client(), client(address=f" {ADDRESS} ")
    first.take()
    first.take()
    with pytest.raises(ConnectionFailedError, match=f"arm_controller: process {os.getpid()} on this machine"):
        second.take()
    first.release()
    first.release()
    second.take()
    second.release()


def test_a_controller_is_the_same_one_however_its_name_is_written() -> None:
    first, second = client(address="Arm-1.lab.local"), client(address=" arm-1.LAB.local")
    first.take()
    with pytest.raises(ConnectionFailedError, match=f"process {os.getpid()} on this machine"):
        second.take()
    first.release()


def test_other_controllers_are_others() -> None:
    clients = [client(), client(driver="other"), client(address="192.168.77.204")]
    for each in clients:
        each.take()
    assert len(list(runtime_folder().glob("*.lock"))) == 3
    for each in clients:
        each.release()
    for each in clients:
        each.take()
    for each in clients:
        each.release()


def test_a_client_that_is_killed_leaves_its_place() -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "taken\n"
        with pytest.raises(ConnectionFailedError, match=f"process {holder.pid} on this machine"):
            client().take()
        holder.send_signal(signal.SIGKILL)
        holder.wait(5.0)
        free = client()
        free.take()
        free.release()
    finally:
        holder.kill()
        holder.communicate()


def test_the_address_stands_nowhere() -> None:
    held = client()
    held.take()
    (lock,) = runtime_folder().glob("*.lock")
    assert ADDRESS not in lock.name
    assert lock.read_text() == str(os.getpid())
    assert lock.stat().st_mode & 0o077 == 0
    with pytest.raises(ConnectionFailedError) as refusal:
        client().take()
    assert ADDRESS not in str(refusal.value)
    held.release()
    lock.write_text("1234567890")  # of a process with a longer number
    held.take()
    assert lock.read_text() == str(os.getpid())
    held.release()


def test_a_client_that_leaves_within_the_patience_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "PATIENCE", 60.0)
    first, second = client(), client()
    first.take()
    leaving = threading.Timer(0.1, first.release)
    leaving.start()
    second.take()
    leaving.join()
    second.release()


class Follower(Connection):
    """Follows whoever speaks to it; ``reachable``: whether its wire can be opened."""

    driver = "follower"
    one_client = True
    reachable = True
    opened = 0

    def factories(self) -> Mapping[str, PartFactory]:
        return {}

    def open(self) -> None:
        if not self.reachable:
            raise ConnectionFailedError("nobody answers")
        self.opened += 1

    def close(self) -> None:
        pass

    def heard(self) -> float:
        return self.clock.now()

    def reported_fault(self) -> Failure | None:
        return None

    def recover(self) -> None:
        pass


def follower(model: RobotModel) -> Follower:
    settings = ConnectionConfig("follower", (), ADDRESS)
    return Follower("arm_controller", settings, model, SafetyConfig(), RealTimeClock(), StopLatch())


def test_a_connection_is_refused_before_it_speaks(robot_model: RobotModel) -> None:
    first, second = follower(robot_model), follower(robot_model)
    first.connect()
    with pytest.raises(ConnectionFailedError, match="connected to its controller already"):
        second.connect()
    assert not second.opened
    first.disconnect()
    second.connect()
    second.disconnect()


def test_a_connection_that_failed_leaves_its_place(robot_model: RobotModel) -> None:
    first, second = follower(robot_model), follower(robot_model)
    first.reachable = False
    with pytest.raises(ConnectionFailedError, match="nobody answers"):
        first.connect()
    second.connect()
    second.disconnect()


def test_only_controllers_that_ask_for_it_are_locked(robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Follower, "one_client", False)
    clients: Mapping[int, Follower] = {number: follower(robot_model) for number in range(2)}
    for each in clients.values():
        each.connect()
    assert all(each.connected and each.opened == 1 for each in clients.values())
    assert not list(runtime_folder().glob("*.lock"))
    for each in clients.values():
        each.disconnect()
