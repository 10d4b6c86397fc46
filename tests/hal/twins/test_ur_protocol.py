"""What the UR twin reads of its clients' bytes and programs is what ur-rtde writes."""

from __future__ import annotations

import socket
import struct
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from hal.twins.faults import Faults
from hal.twins.ur_kinematics import URKinematics
from hal.twins.ur_program import Command, URProgram, path_of
from hal.twins.ur_rtde import DATA, SETUP_INPUTS, Recipe, RtdeSession
from hal.ur.sdk_process import PROGRAM
from tests.robot_models import arm_model


def test_a_path_is_read_as_the_sdk_writes_it() -> None:
    sdk = pytest.importorskip("rtde_control", reason="the extra ur is not installed")
    path = sdk.Path()
    path.appendMovejPath([[0.1, -0.2, 0.3, 0, 1e-9, 0.6, 0.5, 1.5, 0.02], [1, 2, 3, 4, 5, 6, 0.25, 1.2, 0.0]])
    script = f"def rtde_control():\n  # inject move path\n{path.toScriptCode()}  end\nend\n"
    first, second = path_of(script)
    assert first.positions == pytest.approx([0.1, -0.2, 0.3, 0, 0, 0.6], abs=1e-6)
    assert (first.speed, first.acceleration) == (0.5, 1.5)
    assert second.positions == pytest.approx([1, 2, 3, 4, 5, 6])
    assert path_of("def rtde_control():\n  # inject move path\nend\n") == []


def test_fields_are_packed_in_the_order_asked_and_unknown_ones_are_named() -> None:
    recipe = Recipe(["timestamp", "actual_q", "safety_mode", "output_int_register_2", "actual_digital_output_bits"])
    assert recipe.known
    packed = recipe.pack({"timestamp": 2.5, "actual_q": (1, 2, 3, 4, 5, 6), "safety_mode": 3})
    assert packed == struct.pack(">d6diiQ", 2.5, 1, 2, 3, 4, 5, 6, 3, 0, 0)
    assert recipe.unpack(packed)["actual_q"] == (1, 2, 3, 4, 5, 6)
    assert Recipe(["timestamp", "tea_temperature"]).types == ("DOUBLE", "NOT_FOUND")


def test_inputs_that_come_together_are_applied_together() -> None:
    ours, theirs = socket.socketpair()
    written: list[tuple[float, Any]] = []
    session = RtdeSession(theirs, Faults(), dict, lambda *inputs: written.append(inputs), {})
    serving = threading.Thread(target=session.serve)
    serving.start()

    def package(command: int, payload: bytes) -> bytes:
        return struct.pack(">HB", 3 + len(payload), command) + payload

    recipe = Recipe(["input_int_register_0", "input_double_register_0"])
    ours.sendall(package(SETUP_INPUTS, ",".join(recipe.names).encode()))
    number = ours.recv(100)[3]
    both = [dict(zip(recipe.names, values, strict=True)) for values in ((11, 0.1), (11, 0.2))]
    ours.sendall(b"".join(package(DATA, bytes([number]) + recipe.pack(one)) for one in both))
    ours.close()
    serving.join(5.0)
    theirs.close()
    assert [inputs for _, inputs in written] == [both]


def test_a_watchdog_counts_from_the_first_line_of_a_program_where_that_sets_it() -> None:
    program, _ = fake_program(PROGRAM.replace("WATCHDOG_FREQUENCY", "4.000"))
    assert program.watchdog_frequency == 4.0
    assert fake_program()[0].watchdog_frequency is None


def fake_program(script: str = "") -> tuple[URProgram, Any]:
    """A program over an arm that does as it is told at once."""
    told: Any = SimpleNamespace(velocities=np.zeros(6), moved=[])
    arm: Any = SimpleNamespace(
        model=arm_model("abcdef", lower=-6.28, upper=6.28, velocity=3.14),
        positions=lambda: np.zeros(6),
        velocities=lambda: told.velocities,
        stop=lambda: None,
        servo=told.moved.append,
        command=lambda velocities: setattr(told, "velocities", velocities),
    )
    return URProgram(script, arm, URKinematics(load_robot_model("diff_ur5"), "arm")), told


def give(program: URProgram, *commands: dict[str, float]) -> None:
    """Run one cycle in which commands arrive."""
    program.advance(0.01, commands[-1], commands)


def servo(position: float) -> dict[str, float]:
    return {"input_int_register_0": int(Command.SERVO_JOINTS), "input_double_register_0": position}


@pytest.mark.parametrize(("positions", "jumped"), [((0.05, 0.1, 0.15, 0.2), False), ((0.05, 0.2), True)])
def test_set_points_that_a_stalled_process_takes_together_are_judged_one_by_one(
    positions: tuple[float, ...], jumped: bool
) -> None:
    program, _ = fake_program()
    give(program, servo(0.0))
    give(program, *map(servo, positions))
    assert program.follower is not None
    assert program.follower.too_fast is jumped


@pytest.mark.parametrize("wrong", [7.0, float("nan")])
def test_a_set_point_beyond_the_joints_limits_is_not_followed(wrong: float) -> None:
    program, told = fake_program()
    inputs = {"input_int_register_0": int(Command.SERVO_JOINTS), "input_double_register_0": wrong}
    program.advance(0.004, inputs, [inputs])
    assert program.limit_exceeded
    assert np.all(np.array(told.moved) == 0.0)


def test_a_speed_goes_on_until_speed_stop_whatever_its_time_is() -> None:
    program, told = fake_program()
    speed = {"input_int_register_0": int(Command.SPEED_JOINTS), "input_double_register_0": 0.3}
    give(program, {**speed, "input_double_register_7": 0.5})
    for _ in range(800):
        program.advance(0.01, speed, [])
    assert told.velocities[0] == 0.3
    give(program, {"input_int_register_0": 0})
    give(program, {"input_int_register_0": int(Command.SPEED_STOP)})
    assert program.outputs["output_int_register_0"] == 1  # it is done when the arm rests
    told.velocities = np.zeros(6)
    program.advance(0.01, {"input_int_register_0": int(Command.SPEED_STOP)}, [])
    assert program.outputs["output_int_register_0"] == 2
    assert not told.velocities.any()


@pytest.mark.parametrize(
    ("first", "second"), [(Command.SPEED_JOINTS, Command.SERVO_JOINTS), (Command.SERVO_JOINTS, Command.SPEED_TOOL)]
)
def test_two_threads_that_move_the_arm_end_the_program(first: Command, second: Command) -> None:
    program, _ = fake_program()
    give(program, {"input_int_register_0": int(first)})
    assert not program.ended
    give(program, {"input_int_register_0": int(second)})
    assert program.ended
