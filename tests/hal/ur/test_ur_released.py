"""What a UR's dashboard tells decides whether anything is begun, and nothing is unlocked or powered on for it."""

from __future__ import annotations

from typing import Any

import pytest

from hal.ur.sdk_process import RefusedError, SDKProcess

WELL = {
    "isInRemoteControl": True,
    "polyscopeVersion": "URSoftware 5.11.0.108249",
    "safetymode": "Safetymode: NORMAL",
    "robotmode": "Robotmode: RUNNING",
}


class Dashboard:
    """Answers questions; anything that would change something is no method of it."""

    def __init__(self, **answers: Any) -> None:
        self._answers = WELL | answers

    def __getattr__(self, name: str) -> Any:
        answer = self._answers[name]
        return lambda: answer


def check(**answers: Any) -> None:
    process = SDKProcess(None, None)  # type: ignore[arg-type]
    process._dashboard = Dashboard(**answers)
    process._check_released()


@pytest.mark.parametrize("safety", ["NORMAL", "REDUCED"])
def test_an_arm_that_runs_is_taken(safety: str) -> None:
    check(safetymode=f"Safetymode: {safety}")


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"isInRemoteControl": False, "polyscopeVersion": "URSoftware 3.15.8.106339"}, "3.15.8.*5.6 or newer.*no CB3"),
        ({"isInRemoteControl": False, "polyscopeVersion": "URSoftware 5.4.3"}, "5.4.3.*5.6 or newer"),
        ({"isInRemoteControl": False}, "switch it on at the teach pendant"),
        ({"safetymode": "Safetymode: ROBOT_EMERGENCY_STOP"}, "released at the robot"),
        ({"safetymode": "Safetymode: PROTECTIVE_STOP"}, "PROTECTIVE_STOP.*bestman-bt robot release"),
        ({"safetymode": "Safetymode: VIOLATION"}, "VIOLATION.*bestman-bt robot release"),
        ({"robotmode": "Robotmode: POWER_OFF"}, "POWER_OFF.*bestman-bt robot release"),
        ({"robotmode": "Robotmode: IDLE"}, "IDLE.*bestman-bt robot release"),
    ],
)
def test_any_other_is_refused_with_what_to_do(answers: dict[str, Any], words: str) -> None:
    with pytest.raises(RefusedError, match=words):
        check(**answers)
