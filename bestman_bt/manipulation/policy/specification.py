"""What a policy needs and gives, readable before it is used; kept as JSON beside its weights."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from bestman_bt.manipulation.policy.errors import PolicyModelError


@dataclass(frozen=True)
class PolicySpecification:
    """Inputs and outputs of one policy.

    ``robot``: the robot model it was trained on; empty: any that fits. ``joint_names``: the n joints, in the order of
    positions and actions. ``space``: value of an ``ActionSpace``. ``horizon``: H; 0: it varies. ``dt``: seconds per
    action. ``executed``: how many actions are carried out before it is asked again; 0: half of them.
    ``goal_size``: entries of the goal vector. ``images``: camera → (H, W) pixels. ``needs_gripper``: whether it
    looks at the gripper's width. ``moves_gripper``: whether its chunks have widths; ``open_width``: metres, that of
    an open gripper, where it only opens and closes.
    ``workspace``: lower and upper corner of the box, in the base frame, in which the tool may be while it acts: where
    it was trained; None: not known.
    """

    joint_names: tuple[str, ...]
    space: str
    horizon: int
    dt: float
    executed: int = 0
    goal_size: int = 7
    robot: str = ""
    images: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    needs_gripper: bool = False
    moves_gripper: bool = False
    open_width: float = 0.0
    workspace: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    description: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Any) -> PolicySpecification:
        """The inverse of ``to_dict``; PolicyModelError names what is wrong."""
        try:
            box = values.get("workspace")
            corners = None if box is None else tuple(tuple(float(x) for x in corner) for corner in box)
            if corners is not None and [len(corner) for corner in corners] != [3, 3]:
                raise ValueError("workspace should be two corners of three numbers")
            known = {
                **values,
                "joint_names": tuple(str(name) for name in values["joint_names"]),
                "space": str(values["space"]),
                "horizon": int(values["horizon"]),
                "dt": float(values["dt"]),
                "images": {str(name): (int(size[0]), int(size[1])) for name, size in values.get("images", {}).items()},
                "workspace": corners,
            }
            return cls(**known)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            raise PolicyModelError(f"this is no policy specification: {error!r} in {values!r}") from error

    def to_json(self) -> str:
        """As JSON text."""
        return json.dumps(self.to_dict())

    @classmethod
    def from_json(cls, text: str) -> PolicySpecification:
        """The inverse of ``to_json``; PolicyModelError if it is none."""
        try:
            return cls.from_dict(json.loads(text))
        except json.JSONDecodeError as error:
            raise PolicyModelError(f"this is no policy specification: {error}") from error
