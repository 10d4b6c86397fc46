"""Inputs and outputs of a policy, readable before use; stored as JSON beside its weights."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.errors import PolicyModelError


@dataclass(frozen=True, eq=False)
class Workspace:
    """``lower``, ``upper``: corners (3,), metres, in the base frame."""

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        corners = np.array([self.lower, self.upper])
        if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (self.lower < self.upper).all():
            raise ManipulationError(f"Workspace should have a lower and an upper corner but has {corners.tolist()}")

    @classmethod
    def from_string(cls, text: str) -> Workspace:
        """Parse ``x;y;z;x;y;z``: lower and upper corner, metres; the form of a port literal."""
        try:
            numbers = [float(part) for part in text.split(";")]
        except ValueError:
            numbers = []
        if len(numbers) != 6:
            raise ManipulationError(
                f"a workspace 'x;y;z;x;y;z' (metres, lower and upper corner) expected, got {text!r}"
            )
        return cls(np.array(numbers[:3]), np.array(numbers[3:]))

    def contains(self, point: NDArray[np.float64], slack: float = 0.0) -> bool:
        """Return whether ``point`` (3,) lies inside, or at most ``slack`` metres outside."""
        return bool((point >= self.lower - slack).all() and (point <= self.upper + slack).all())

    def first_outside(
        self, path: NDArray[np.float64], kinematics: InverseKinematics, max_step: float = 0.02
    ) -> NDArray[np.float64] | None:
        """Return the first tool position (3,) outside along joint waypoints (N, n), sampled every ``max_step`` rad, or
        None.
        """
        for start, end in pairwise(path):
            count = max(1, int(np.ceil(np.abs(end - start).max() / max_step)))
            for k in range(1, count + 1):
                position = kinematics.tool_pose(start + (end - start) * k / count).position
                if not self.contains(position):
                    return position
        return None

    def __str__(self) -> str:
        spans = (
            f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)
        )
        return ", ".join(spans) + " m"


class ActionSpace(StrEnum):
    """The meaning of the columns of an action."""

    JOINT_POSITIONS = "joint_positions"  # radians
    JOINT_DELTAS = "joint_deltas"  # radians, each added to the positions after the action before
    TOOL_TWIST = "tool_twist"  # vx, vy, vz (m/s), wx, wy, wz (rad/s) of the tool, in the base frame's directions


@dataclass(frozen=True)
class PolicySpecification:
    """Inputs and outputs of one policy.

    ``robot``: the robot model of the training; empty: any suitable one. ``joint_names``: the n joints, in the order of
    positions and actions. ``space``: an ``ActionSpace``. ``horizon``: H; 0: variable. ``dt``: seconds per action.
    ``executed``: actions to execute before the next query; 0: half of them. ``goal_size``: entries of the goal vector.
    ``images``: camera → (H, W) pixels. ``moves_gripper``: whether chunks have widths; ``open_width``: metres of an open
    gripper, for binary ones. ``workspace``: lower and upper corner of the tool's box, in the base frame, from the
    training; None: unknown.
    """

    joint_names: tuple[str, ...]
    space: str
    horizon: int
    dt: float
    executed: int = 0
    goal_size: int = 7
    robot: str = ""
    images: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    moves_gripper: bool = False
    open_width: float = 0.0
    workspace: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    description: str = ""

    def __post_init__(self) -> None:
        faults = list(_faults(self))
        if faults:
            raise PolicyModelError(f"this is not a policy specification: {'; '.join(faults)}")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Any) -> PolicySpecification:
        """Return the inverse of ``to_dict``. Raises PolicyModelError naming the faults."""
        if not isinstance(values, dict):
            raise PolicyModelError(f"this is not a policy specification: it should hold fields, got {values!r}")
        names = [option.name for option in fields(cls)]
        unknown = [f"unknown field {name!r}, known: {', '.join(names)}" for name in values if name not in names]
        missing = [f"{name} is missing" for name in ("joint_names", "space", "horizon", "dt") if name not in values]
        if unknown or missing:
            raise PolicyModelError(f"this is not a policy specification: {'; '.join(unknown + missing)}")
        joints, images, box = values["joint_names"], values.get("images", {}), values.get("workspace")
        try:
            if not isinstance(joints, (list, tuple)):
                raise ValueError(f"joint_names should be a list, got {joints!r}")
            known = {
                **values,
                "joint_names": tuple(str(name) for name in joints),
                "images": {str(name): (int(size[0]), int(size[1])) for name, size in images.items()},
                "workspace": None if box is None else tuple(tuple(float(x) for x in corner) for corner in box),
            }
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise PolicyModelError(f"this is not a policy specification: {error}") from error
        return cls(**known)

    def to_json(self) -> str:
        """Return JSON text."""
        return json.dumps(self.to_dict())

    @classmethod
    def from_json(cls, text: str) -> PolicySpecification:
        """Return the inverse of ``to_json``. Raises PolicyModelError if it is invalid."""
        try:
            return cls.from_dict(json.loads(text))
        except json.JSONDecodeError as error:
            raise PolicyModelError(f"this is not a policy specification: {error}") from error


def _faults(given: PolicySpecification) -> Iterator[str]:
    """Yield the faults of a specification, which no policy can satisfy."""
    spaces = [space.value for space in ActionSpace]
    if given.space not in spaces:
        yield f"space should be one of {', '.join(spaces)}, got {given.space!r}"
    if not given.joint_names:
        yield "joint_names should name at least one joint"
    for name in ("horizon", "executed", "goal_size"):
        value = getattr(given, name)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            yield f"{name} should be a whole number, 0 or more, got {value!r}"
    for name, least in (("dt", "above"), ("open_width", "not below")):
        value = getattr(given, name)
        right = (
            isinstance(value, (int, float)) and math.isfinite(value) and (value > 0 if least == "above" else value >= 0)
        )
        if not right:
            yield f"{name} should be a finite number {least} 0, got {value!r}"
    for camera, size in given.images.items():
        if min(size) <= 0:
            yield f"images of {camera!r} should have a height and a width above 0, got {size}"
    box = given.workspace
    if box is not None and (
        [len(corner) for corner in box] != [3, 3]
        or not all(math.isfinite(x) for corner in box for x in corner)
        or not all(low < high for low, high in zip(*box, strict=True))
    ):
        yield f"workspace should be a lower and an upper corner of three numbers each, got {box}"
