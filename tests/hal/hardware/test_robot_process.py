"""The process that holds a robot's connections: what it answers, asked over a wire within this one."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import RobotModel
from hal.api import Failure, MotionStatus
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.robot_process import (
    REMEMBERED_MOTIONS,
    ROBOT,
    Call,
    MotionNumber,
    MotionReport,
    RobotServer,
    ServerSetup,
)
from hal.parts.channels import BaseChannel, BaseReading
from hal.parts.driven_base import DrivenBase

Ask = Callable[[Call], Any]


class Wheels(BaseChannel):
    """Of a base that stays where it is."""

    def read(self) -> BaseReading:
        return BaseReading(Pose2D(0.0, 0.0, 0.0), Twist2D(0.0, 0.0, 0.0))

    def send(self, velocity: Twist2D) -> bool:
        return True


class Controller(Connection):
    """Nothing is wrong with it."""

    def factories(self) -> Mapping[str, PartFactory]:
        return {"base": lambda name, model: DrivenBase(name, model, Wheels(), self.latch)}

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def heard(self) -> float:
        return self.clock.now()

    def reported_fault(self) -> Failure | None:
        return None

    def recover(self) -> None:
        pass


@pytest.fixture
def ask(robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ask]:
    """Sends a call to a server of a robot that is connected; gives back its answer."""
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    model = replace(robot_model, connections={"platform": ConnectionConfig("any", ("base",))})
    ours, theirs = multiprocessing.Pipe()
    serving = threading.Thread(target=RobotServer(ServerSetup(model, 0.0)).serve, args=(theirs,), daemon=True)
    serving.start()

    def ask(call: Call) -> Any:
        ours.send(call)
        assert ours.poll(60.0)
        return ours.recv()

    assert ask(Call(ROBOT, "connect")) is None
    yield ask
    ask(Call(ROBOT, "disconnect"))
    ours.close()
    serving.join(60.0)


def test_of_very_many_motions_the_latest_are_remembered(ask: Ask) -> None:
    numbers = [ask(Call("base", "rotate", (1.0,))) for _ in range(REMEMBERED_MOTIONS + 1)]
    assert all(isinstance(number, MotionNumber) for number in numbers)
    last = ask(Call(numbers[-1].number, "poll"))
    assert isinstance(last, MotionReport)
    assert last.status is MotionStatus.RUNNING
    before = ask(Call(numbers[1].number, "poll"))
    assert isinstance(before, MotionReport)
    assert before.status is MotionStatus.CANCELED  # superseded
    assert isinstance(ask(Call(numbers[0].number, "poll")), Exception)


def test_a_controller_that_could_not_be_disconnected_is_stopped_when_the_server_ends(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Breaking] = []

    class Breaking(Controller):
        """Its wire breaks when it is closed, at the first try."""

        def factories(self) -> Mapping[str, PartFactory]:
            made.append(self)
            self.calls: list[str] = []
            return {} if "base" not in self.settings.parts else super().factories()

        def close(self) -> None:
            self.calls.append("close")
            if self.calls == ["close"] and self.name == "platform":
                raise OSError("broken pipe")

        def stop(self) -> None:
            self.calls.append("stop")

    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Breaking)
    connections = {"platform": ConnectionConfig("any", ("base",)), "other": ConnectionConfig("any", ())}
    server = RobotServer(ServerSetup(replace(robot_model, connections=connections), 0.0))
    ours, theirs = multiprocessing.Pipe()
    serving = threading.Thread(target=server.serve, args=(theirs,), daemon=True)
    serving.start()
    for method in ("connect", "disconnect"):
        ours.send(Call(ROBOT, method))
        assert ours.poll(60.0)
        answer = ours.recv()
    assert "broken pipe" in str(answer)
    platform, other = made
    assert [one.connected for one in made] == [True, False]
    ours.close()
    serving.join(60.0)
    server.close()
    assert platform.calls == ["close", "stop", "close"]
    assert other.calls[0] == "close"
    assert not platform.connected
