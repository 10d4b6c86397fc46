"""The settings of an xArm's twin are those of the robot's file, until a fault changes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from hal.hardware.controller_facts import ArmFacts, compare_mounting
from hal.twins.xarm_settings import XArmSettings

ROBOT = Path(__file__).parents[1] / "xarm" / "xarm6_on_a_base.yaml"


@pytest.mark.parametrize(
    ("rpy", "gravity"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        ((0.0, np.pi / 2, 0.0), (1.0, 0.0, 0.0)),
        ((np.pi, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.4, 1.0), (np.sin(0.4), 0.0, -np.cos(0.4))),
    ],
)
def test_an_xarm_reports_gravity_in_its_base_as_it_is_mounted(
    rpy: tuple[float, float, float], gravity: tuple[float, float, float]
) -> None:
    model = load_robot_model(ROBOT, {"parts.arm.rpy": list(rpy)})
    settings = XArmSettings.of(model, "arm", "XI130400000000")
    assert settings.gravity == pytest.approx(gravity, abs=1e-6)
    for fault, agrees in (("other_mounting", False), ("as_built", True)):
        settings.faults()[fault]()
        compared = compare_mounting(model, "arm", ArmFacts(np.zeros(6), Pose(), gravity=np.array(settings.gravity)))
        assert compared is not None
        assert compared.agrees is agrees
