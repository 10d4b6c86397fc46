"""Which reports of a UR's controller are a fault, with which code and number; its digital channels."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.robot_model.connection_config import SafetyConfig
from hal.api import CommandRefusedError, Failure, MotionErrorCode, NoDataError
from hal.parts.stop_latch import StopLatch
from hal.ur.connection import URConnection, URDigitalIO, UROptions, fault_of, scaling_of
from hal.ur.sdk_process import Report


def report(**values: Any) -> Report:
    zeros = [0.0] * 6
    return Report(0.0, 0.0, zeros, zeros, zeros, zeros, zeros, 0, 0, 7, 1, 2, False, False)._replace(**values)


@pytest.mark.parametrize(
    ("values", "code", "number"),
    [
        ({"safety_mode": 3}, MotionErrorCode.COLLISION, "safety mode 3"),
        *(({"safety_mode": mode}, MotionErrorCode.STOPPED, f"safety mode {mode}") for mode in (5, 6, 7, 12, 13)),
        *(({"safety_mode": mode}, MotionErrorCode.FAULT, f"safety mode {mode}") for mode in (4, 8, 9, 99)),
        ({"robot_mode": 5}, MotionErrorCode.FAULT, "robot mode 5"),
        ({"robot_mode": 3, "busy": True}, MotionErrorCode.FAULT, "robot mode 3"),
        ({"runtime_state": 1}, MotionErrorCode.FAULT, "runtime state 1"),
        ({"safety_mode": 3, "robot_mode": 5, "busy": True}, MotionErrorCode.COLLISION, "safety mode 3"),
    ],
)
def test_what_keeps_a_controller_from_being_commanded_is_a_fault(
    values: dict[str, Any], code: MotionErrorCode, number: str
) -> None:
    fault = fault_of(report(**values))
    assert fault is not None
    assert (fault.code, fault.vendor_code) == (code, number)


@pytest.mark.parametrize("values", [{}, {"safety_mode": 2}, {"runtime_state": 4}, {"runtime_state": 1, "busy": True}])
def test_a_controller_that_is_well_reduced_paused_or_exchanges_its_program_has_no_fault(values: dict[str, Any]) -> None:
    assert fault_of(report(**values)) is None


@pytest.mark.parametrize(
    ("values", "scaling"),
    [
        ({}, 1.0),
        ({"scaling": 0.3}, 0.3),
        ({"scaling": 0.3, "runtime_state": 4}, 0.0),
        ({"safety_mode": 2}, 0.25),
        ({"safety_mode": 2, "scaling": 0.1}, 0.1),
    ],
)
def test_motions_pass_in_the_controllers_time(values: dict[str, Any], scaling: float) -> None:
    assert scaling_of(report(**values), 0.25) == scaling


def test_each_digital_channel_has_its_bit_and_a_stopped_robot_switches_none() -> None:
    calls: list[tuple[Any, ...]] = []
    link: Any = SimpleNamespace(report=None, call=lambda *arguments, timeout: calls.append(arguments))
    latch = StopLatch()
    io = URDigitalIO(link, latch)
    with pytest.raises(NoDataError):
        io.output("tool", 0)
    for kind, first, count in (("standard", 0, 8), ("configurable", 8, 8), ("tool", 16, 2)):
        for number in range(count):
            link.report = report(digital_outputs=1 << first + number, digital_inputs=~(1 << first + number))
            assert io.output(kind, number)
            assert not io.input(kind, number)
        for wrong in (-1, count):
            with pytest.raises(CommandRefusedError, match=kind):
                io.set_output(kind, wrong, True)
    io.set_output("tool", 1, True)
    assert calls == [("set_output", "tool", 1, True)]
    latch.set(Failure(MotionErrorCode.COLLISION, "a collision"))
    with pytest.raises(CommandRefusedError, match="a collision"):
        io.set_output("tool", 1, False)
    assert len(calls) == 1


@pytest.mark.parametrize(
    ("silence", "values", "sent"), [(0.09, {}, True), (0.11, {}, False), (0.0, {"safety_mode": 3}, False)]
)
def test_set_points_go_out_while_the_controller_is_heard_and_well(
    silence: float, values: dict[str, Any], sent: bool
) -> None:
    cycles: list[float] = []
    connection: Any = SimpleNamespace(
        _link=SimpleNamespace(pump=lambda: report(**values), heard=5.0 - silence, beat=lambda: None),
        clock=SimpleNamespace(now=lambda: 5.0),
        limits=SafetyConfig(watchdog=0.1),
        options=UROptions(),
        _arm=SimpleNamespace(cycle=cycles.append, give_way=lambda: None),
    )
    URConnection._cycle(connection, 0.01)
    assert bool(cycles) is sent
