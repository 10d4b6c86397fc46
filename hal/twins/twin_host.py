"""One process with the world and the protocol twins of all controllers of a robot."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Pose
from bestman_bt.registry import Registry
from bestman_bt.robot_model.bringup_file import TWIN_SUFFIX, BringUpFile, Signature, SignedStep
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.scene import World
from hal.api import Gripper, JointGroup
from hal.twins.errors import TwinError
from hal.twins.faults import Faults
from hal.twins.tcp_server import JsonLineServer
from hal.twins.world import TwinWorld


class JudgeServer(JsonLineServer):
    """Answers ``{"ask": QUESTION, "name": NAME}`` with ``{"answer": …}``.

    Questions are the methods of ``GroundTruth``, ``audit_record``, ``time``, ``joints`` (true positions and velocities
    of a part) and ``width`` (of a gripper).
    """

    def __init__(self, path: Path, world: TwinWorld) -> None:
        super().__init__(path, self._judge)
        self._world = world
        truth = world.truth
        self._questions: dict[str, Callable[[str], Any]] = {
            "object_names": lambda name: truth.object_names,
            "object_pose": truth.object_pose,
            "object_speed": truth.object_speed,
            "furniture_pose": truth.furniture_pose,
            "articulation_names": lambda name: truth.articulation_names,
            "articulation_position": truth.articulation_position,
            "base_pose": lambda name: truth.base_pose(),
            "frame_pose": truth.frame_pose,
            "touches_robot": truth.touches_robot,
            "supports": truth.supports,
            "audit_record": lambda name: dataclasses.asdict(world.robot.audit_record()),
            "time": lambda name: {"time": world.now(), "given_up": world.watch.given_up},
            "joints": self._joints,
            "width": lambda name: world.robot.part(name, Gripper).width(),
        }

    def _judge(self, question: dict[str, Any]) -> Mapping[str, Any]:
        asked = str(question.get("ask", ""))
        if asked not in self._questions:
            raise LookupError(f"unknown request {asked!r}; known: {', '.join(self._questions)}")
        answer = self._world.call(lambda: self._questions[asked](str(question.get("name", ""))))
        return {"answer": _plain(answer)}

    def _joints(self, name: str) -> Mapping[str, Any]:
        group = self._world.robot.part(name, JointGroup)
        return {"positions": group.positions().tolist(), "velocities": group.velocities().tolist()}


def _plain(answer: Any) -> Any:
    if isinstance(answer, Pose):
        return {"position": answer.position.tolist(), "quaternion": answer.quaternion.tolist()}
    return answer


TWINS = Registry(
    "bestman_bt.twins",
    "protocol twin",
    {
        "xarm": "hal.twins.xarm_server:XArmTwin",
        "ur": "hal.twins.ur_server:URTwin",
        "realsense": "hal.twins.usb_camera:UsbCameraTwin",
        "robotiq": "hal.twins.robotiq_server:RobotiqTwin",
        "rosbridge": "hal.twins.rosbridge_server:RosbridgeTwin",
    },
)
"""Driver of a connection → the class that speaks the controller's side of its protocol."""
REAL_TIME_PRIORITY = 10
FIRST_ADDRESS, LAST_ADDRESS = 2, 254


class Twin(Protocol):
    """The simulated controller of one connection.

    Created as ``(connection, model, world, address)``, before the world starts. Raises OSError if a port on the address
    is taken. It registers its state in ``world.ticks``. If clients use another driver than the connection's own, it is
    named in ``reached_by``; a controller that reports a serial number has ``serial_number``.
    """

    faults: Faults

    def start(self) -> None:
        """Accept clients."""

    def close(self) -> None:
        """Close all ports."""


@dataclass(frozen=True)
class Hosted:
    """The addresses of a host: connection → address; the sockets of the judge and of the faults.

    ``drivers``: connection → the driver that its clients use instead of its own. ``bringup``: a file that signs the
    bring-up of this robot with these twins, so that its arms may move at the full speed of the robot's file.
    """

    addresses: Mapping[str, str]
    drivers: Mapping[str, str]
    judge: Path | None
    faults: Path
    bringup: Path

    def document(self) -> dict[str, Any]:
        """Return the configuration as JSON. ``settings``: for ``--set``, so that the robot's YAML reaches the twins."""
        settings = [f"robot.connections.{name}.address={at}" for name, at in self.addresses.items()]
        settings += [f"robot.connections.{name}.driver={driver}" for name, driver in self.drivers.items()]
        settings.append(f"robot.bringup={self.bringup}")
        return {
            "addresses": dict(self.addresses),
            "judge": str(self.judge) if self.judge is not None else None,
            "faults": str(self.faults),
            "settings": settings,
        }


class TwinHost:
    """Hosts the twins of a robot's connections over one world, each on its own loopback address.

    ``run`` blocks, in the process's main thread; ``close`` ends it. ``judge``: whether to open the judge's socket.
    ``engine``: the driver that simulates.
    """

    def __init__(
        self,
        model: RobotModel,
        scene_world: World,
        seed: int = 0,
        judge: bool = False,
        engine: str = DEFAULT_SIMULATOR,
    ) -> None:
        if not model.connections:
            raise TwinError(f"robot {model.name!r} has no connections in its YAML, so it has no device to simulate")
        self._model, self._judge = model, judge
        spoken_for = {part for connection in model.connections.values() for part in connection.parts}
        cameras = bool(spoken_for & set(model.of(CameraPart)))
        self.world = TwinWorld(model, scene_world, seed, cameras=cameras, engine=engine)
        self.twins: dict[str, Twin] = {}

    def run(self, ready: Callable[[Hosted], None]) -> None:
        """Build the world, open all ports, call ``ready``, and run until ``close()``.

        If the system allows it, the process then has real-time priority, because controllers must reply in time on a
        busy machine.
        """
        with tempfile.TemporaryDirectory(prefix="bestman_twin_") as folder:
            servers: list[JsonLineServer] = []
            addresses: dict[str, str] = {}

            def open_all() -> None:
                with contextlib.suppress(PermissionError):
                    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REAL_TIME_PRIORITY))
                free = iter(range(FIRST_ADDRESS, LAST_ADDRESS))
                for name, connection in self._model.connections.items():
                    self.twins[name], addresses[name] = self._place(connection, free)
                faults = Path(folder) / "faults"
                servers.append(JsonLineServer(faults, self._fault))
                judge = Path(folder) / "judge" if self._judge else None
                if judge is not None:
                    servers.append(JudgeServer(judge, self.world))
                for twin in self.twins.values():
                    twin.start()
                for server in servers:
                    server.start()
                reached_by = {name: getattr(twin, "reached_by", "") for name, twin in self.twins.items()}
                drivers = {name: driver for name, driver in reached_by.items() if driver}
                bringup = Path(folder) / f"{self._model.name}{TWIN_SUFFIX}"
                self._sign().write(bringup)
                ready(Hosted(addresses, drivers, judge, faults, bringup))

            try:
                self.world.run(open_all)
            finally:
                for twin in self.twins.values():
                    twin.close()
                for server in servers:
                    server.close()

    def close(self) -> None:
        """End ``run``; from any thread or a signal handler."""
        self.world.close()

    def _sign(self) -> BringUpFile:
        """Sign the bring-up with the values that are compared on connecting: twins match the robot's file."""
        serial_numbers = {name: getattr(twin, "serial_number", "") for name, twin in self.twins.items()}
        numbers = {name: number for name, number in serial_numbers.items() if number}
        who, when = "bestman-bt twin", time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        arms: dict[str, Any] = {arm: {} for arm in self._model.of(ArmModel)}
        compared = SignedStep("passed", when, who, "twins match the robot's file", arms)
        steps = dict.fromkeys(("tool", "payload", "mounting"), compared)
        return BringUpFile(self._model.name, self._model.content, numbers, {}, True, steps, Signature(who, when))

    def _place(self, connection: ConnectionConfig, free: Any) -> tuple[Twin, str]:
        """Return a twin on the first loopback address whose ports are free."""
        make = cast(Callable[..., Twin], TWINS.resolve(connection.driver))
        why: OSError | None = None
        for number in free:
            address = f"127.0.0.{number}"
            try:
                return make(connection, self._model, self.world, address), address
            except PermissionError as error:
                raise TwinError(
                    "a port below 1024 needs privileges: run as root, or sysctl net.ipv4.ip_unprivileged_port_start=502"
                ) from error
            except OSError as error:
                why = error
        raise TwinError("no loopback address has the twin's ports free") from why

    def _fault(self, question: dict[str, Any]) -> Mapping[str, Any]:
        """Apply a request ``{"connection": NAME, "fault": NAME, "value": NUMBER}``; without a fault, return the
        available ones.
        """
        name = str(question.get("connection", ""))
        if name not in self.twins:
            raise LookupError(f"no connection {name!r}; there are {', '.join(self.twins)}")
        faults = self.twins[name].faults
        if "fault" in question:
            faults.trigger(str(question["fault"]), question.get("value"))
        return {"faults": faults.names}
