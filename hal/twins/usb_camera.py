"""A replacement for a USB camera, which has no network protocol to emulate: clients reach it through rosbridge."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import RobotModel
from hal.twins.rosbridge_server import RosbridgeTwin
from hal.twins.world import TwinWorld


class UsbCameraTwin(RosbridgeTwin):
    """Replaces a USB camera; its clients use the driver ``rosbridge`` with its default options instead of the
    camera's.
    """

    reached_by: ClassVar[str] = "rosbridge"

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        driver: Any = CONNECTIONS.resolve(self.reached_by)
        options = driver.options_type()
        usual = dataclasses.replace(connection, driver=self.reached_by, options=options)
        super().__init__(usual, model, world, address)
