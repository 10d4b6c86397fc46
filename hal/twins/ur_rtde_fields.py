"""The fields of Universal Robots' RTDE interface: their types, and how these are packed (big endian)."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from typing import Any

FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
_TYPES: tuple[tuple[str, str], ...] = (
    (r"(actual|target)_(q|qd|qdd|current|moment)|actual_current_as_torque|joint_control_output", "VECTOR6D"),
    (r"(actual|target)_TCP_(pose|speed)|actual_TCP_force|ft_raw_wrench|external_force_torque", "VECTOR6D"),
    (r"joint_temperatures|actual_joint_voltage|payload_inertia", "VECTOR6D"),
    (r"actual_tool_accelerometer|payload_cog|elbow_position|elbow_velocity", "VECTOR3D"),
    (r"joint_mode", "VECTOR6INT32"),
    (r"robot_mode|safety_mode|(in|out)put_int_register_\d+", "INT32"),
    (r"actual_digital_(in|out)put_bits", "UINT64"),
    (r"runtime_state|robot_status_bits|safety_status_bits|speed_slider_mask|output_bit_registers\w+", "UINT32"),
    (r"(standard|configurable|tool)_digital_output(_mask)?|standard_analog_output_(mask|type)", "UINT8"),
    (r"(in|out)put_bit_register_\d+", "BOOL"),
    (r"(in|out)put_double_register_\d+|timestamp|speed_scaling|target_speed_fraction|payload", "DOUBLE"),
    (r"actual_(execution_time|momentum|main_voltage|robot_voltage|robot_current)", "DOUBLE"),
    (r"standard_analog_(in|out)put_?[01]|speed_slider_fraction", "DOUBLE"),
)


def field_type(name: str) -> str | None:
    """The RTDE type of a field, None where there is no such field."""
    return next((kind for pattern, kind in _TYPES if re.fullmatch(pattern, name)), None)


class Recipe:
    """An agreed list of fields; one without known fields is refused by the controller and not made."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.types = tuple(field_type(name) or "NOT_FOUND" for name in names)
        formats = [FORMATS.get(kind, "") for kind in self.types]
        self._sizes = [int(form[0]) if form[:1].isdigit() else 1 for form in formats]
        self._struct = struct.Struct(">" + "".join(formats))

    @property
    def known(self) -> bool:
        """Whether the controller has all of its fields."""
        return "NOT_FOUND" not in self.types

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """The values of its fields; what has none is zero."""
        numbers: list[Any] = []
        for name, size in zip(self.names, self._sizes, strict=True):
            if size == 1:
                numbers.append(values.get(name, 0))
            else:
                numbers.extend(values.get(name, (0,) * size))
        return self._struct.pack(*numbers)

    def unpack(self, data: bytes) -> dict[str, Any]:
        """Field → value, a tuple for vectors; struct.error where the length is wrong."""
        numbers = iter(self._struct.unpack(data))
        values: dict[str, Any] = {}
        for name, size in zip(self.names, self._sizes, strict=True):
            values[name] = next(numbers) if size == 1 else tuple(next(numbers) for _ in range(size))
        return values
