"""The twin of a UR e-series controller: dashboard on port 29999, programs on 30003, RTDE on 30004."""

from __future__ import annotations

import re
import socket

from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import MountedForceTorque
from hal.api import Arm, ForceTorque
from hal.twins.tcp_server import TcpTwin, lines
from hal.twins.ur_controller import SafetyMode, URController
from hal.twins.ur_rtde import POLYSCOPE, RtdeSession
from hal.twins.world import TwinWorld

DASHBOARD, SCRIPT, RTDE = 29999, 30003, 30004
GREETING = "Connected: Universal Robots Dashboard Server"
SERIAL_NUMBER, OTHER_SERIAL_NUMBER = "20215500000", "20215500099"
OTHER_LENGTH = 0.005
"""Metres by which the fault ``other_length`` lengthens the arm."""


class URTwin(TcpTwin):
    """Serves one arm on ``address``. Raises OSError if a port is not available."""

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        arm_name = next(name for name in connection.parts if name in model.of(ArmModel))
        sensor_name = next((name for name in connection.parts if name in model.of(MountedForceTorque)), None)
        self._model = (
            (connection.options.model or "ur5e").upper().removesuffix("E")
        )  # as a dashboard names the e-series
        self._owners: dict[str, RtdeSession] = {}
        super().__init__(
            address, {DASHBOARD: self._attend_dashboard, SCRIPT: self._attend_script, RTDE: self._attend_rtde}
        )
        self.controller = controller = URController(
            world,
            world.robot.part(arm_name, Arm),
            world.robot.part(sensor_name, ForceTorque) if sensor_name else None,
            model,
        )
        self.serial_number = SERIAL_NUMBER
        self.faults.add(
            {
                "other_serial": lambda: setattr(self, "serial_number", OTHER_SERIAL_NUMBER),
                "other_length": lambda: controller.lengthen(OTHER_LENGTH),
                "other_mounting": lambda: controller.mount(upside_down=True),
                "as_built": self._restore,
                "protective_stop": lambda: controller.trip(SafetyMode.PROTECTIVE_STOP),
                "joint_limit": lambda: controller.trip(SafetyMode.VIOLATION),
                "emergency_stop": lambda: controller.trip(SafetyMode.ROBOT_EMERGENCY_STOP),
                "released": controller.be_released,
                "emergency_release": controller.restart_safety,
                "program_stop": controller.end_program,
                "other_wrench_sign": controller.turn_wrench,
                "pause": lambda: controller.pause(True),
                "play": lambda: controller.pause(False),
                "reduced": lambda: controller.reduce(True),
                "full_speed": lambda: controller.reduce(False),
            },
            {"speed_slider": controller.set_slider},
        )

    def _restore(self) -> None:
        self.serial_number = SERIAL_NUMBER
        self.controller.lengthen(0.0)
        self.controller.mount(upside_down=False)

    def _attend_rtde(self, client: socket.socket) -> None:
        RtdeSession(client, self.faults, self.controller.read, self.controller.write, self._owners).serve()

    def _attend_script(self, client: socket.socket) -> None:
        """Receive programs, each of which ends with an ``end`` at the beginning of a line."""
        text = ""
        for chunk in self.received(client):
            text += chunk.decode("ascii", "replace")
            while (complete := re.search(r"^end[ \t]*\n", text, re.MULTILINE)) is not None:
                self.controller.upload(text[: complete.end()])
                text = text[complete.end() :]

    def _attend_dashboard(self, client: socket.socket) -> None:
        self.send(client, GREETING.encode() + b"\n")
        for line in lines(self.received(client)):
            self.send(client, self._answer(line.strip()).encode() + b"\n")

    def _answer(self, request: str) -> str:
        controller = self.controller
        match request.lower():
            case "polyscopeversion":
                return "URSoftware " + ".".join(map(str, POLYSCOPE))
            case "get serial number":
                return self.serial_number
            case "get robot model":
                return self._model
            case "is in remote control":
                return "true"
            case "robotmode":
                return f"Robotmode: {controller.robot_mode.name}"
            case "safetymode" | "safetystatus" as question:
                return f"{question.capitalize()}: {controller.safety_mode.name}"
            case "running":
                return f"Program running: {str(controller.playing).lower()}"
            case "programstate":
                return "PLAYING rtde_control" if controller.playing else "STOPPED rtde_control"
            case "unlock protective stop":
                unlocked = controller.unlock()
                return (
                    "Protective stop releasing"
                    if unlocked
                    else "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective "
                    "stop before unlocking"
                )
            case "restart safety":
                controller.restart_safety()
                return "Restarting safety"
            case "power on":
                controller.power(True)
                return "Powering on"
            case "power off":
                controller.power(False)
                return "Powering off"
            case "brake release":
                controller.release_brakes()
                return "Brake releasing"
            case "stop":
                controller.end_program()
                return "Stopped"
            case "close popup":
                return "closing popup"
            case "close safety popup":
                return "closing safety popup"
        return f"could not understand: '{request}'"
