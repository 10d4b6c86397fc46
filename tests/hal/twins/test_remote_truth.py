"""The judge of the twins tells the same truth as the simulation does."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.simulation.audit_record import AuditRecord
from hal.twins.remote_truth import RemoteTruth
from hal.twins.twin_host import JudgeServer
from hal.twins.world import TwinWorld


@pytest.fixture(scope="module")
def judged(
    robot_model: RobotModel, table_worlds: dict[str, World], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[TwinWorld, RemoteTruth]]:
    world = TwinWorld(robot_model, table_worlds["box"], seed=1)
    path: Path = tmp_path_factory.mktemp("judge") / "socket"
    servers: list[JudgeServer] = []
    ready = threading.Event()

    def open_socket() -> None:
        servers.append(JudgeServer(path, world))
        servers[0].start()
        ready.set()

    thread = threading.Thread(target=world.run, args=(open_socket,))
    thread.start()
    assert ready.wait(60.0)
    yield world, RemoteTruth(path)
    world.close()
    thread.join(10.0)
    servers[0].close()
    assert not path.exists()


def test_it_answers_all_that_ground_truth_does(judged: tuple[TwinWorld, RemoteTruth]) -> None:
    world, remote = judged
    local = world.truth
    assert remote.object_names == ("box",)
    assert remote.articulation_names == ()
    assert remote.supports("box") == world.call(lambda: local.supports("box")) == ("table",)
    assert not remote.touches_robot("box")
    for ours, theirs in (
        (remote.object_pose("box"), world.call(lambda: local.object_pose("box"))),
        (remote.furniture_pose("table"), world.call(lambda: local.furniture_pose("table"))),
        (remote.base_pose(), world.call(local.base_pose)),
        (remote.frame_pose("panda_hand"), world.call(lambda: local.frame_pose("panda_hand"))),
    ):
        assert ours.position == pytest.approx(theirs.position, abs=1e-4)
    assert max(remote.object_speed("box")) < 0.01


def test_the_record_of_the_monitor_comes_as_it_is(judged: tuple[TwinWorld, RemoteTruth]) -> None:
    _, remote = judged
    record = remote.audit_record()
    assert isinstance(record, AuditRecord)
    assert record.duration > 0.0
    assert record.resets == record.constraints == record.truth_reads == record.tampering == 0
    assert record.jumps == ()


def test_what_is_not_there_is_reported(judged: tuple[TwinWorld, RemoteTruth]) -> None:
    _, remote = judged
    with pytest.raises(LookupError, match="no object 'cup'"):
        remote.object_pose("cup")
