"""Policies: from an observation to the next few actions of the arm (an action chunk).

Chunks as in Zhao et al., "Learning fine-grained bimanual manipulation with low-cost hardware" (ACT), RSS 2023.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.policy.errors import PolicyActionError, PolicyObservationError
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.messages import Pose


@dataclass(frozen=True, eq=False)
class Observation:
    """The input of a policy at one moment.

    ``joint_positions``: (n,) radians. ``base_from_tool``: from encoders. ``gripper_width``: metres, or None. ``goal``:
    (g,), as specified; for reaching x, y, z and the quaternion xyzw of the tool in the base frame, for picking the
    perceived pose of the object. ``images``: camera role → (H, W, 3) uint8 RGB. ``joint_velocities``: (n,) rad/s,
    currently commanded, or None. Raises PolicyObservationError.
    """

    joint_positions: NDArray[np.float64]
    base_from_tool: Pose
    goal: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    gripper_width: float | None = None
    images: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    joint_velocities: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for name in ("joint_positions", "goal", "joint_velocities"):
            if getattr(self, name) is None:
                continue
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 1 or not np.isfinite(values).all():
                raise PolicyObservationError(f"Observation {name} should be a finite (n,) array but is {values}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        for name, image in self.images.items():
            if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
                raise PolicyObservationError(
                    f"Observation image {name!r} should be (H, W, 3) uint8 but is {image.shape} {image.dtype}"
                )


@dataclass(frozen=True, eq=False)
class ActionChunk:
    """The next H actions, ``dt`` seconds each.

    ``actions``: (H, n) float64 in the units of ``space``. ``gripper_widths``: (H,) metres, or None if the policy does
    not command the gripper. Raises PolicyActionError for another shape, NaN or infinity.
    """

    actions: NDArray[np.float64]
    dt: float
    space: ActionSpace
    gripper_widths: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        actions = np.array(self.actions, dtype=float)
        if actions.ndim != 2 or 0 in actions.shape:
            raise PolicyActionError(f"ActionChunk actions should have shape (H, n) but have {actions.shape}")
        if self.space is ActionSpace.TOOL_TWIST and actions.shape[1] != 6:
            raise PolicyActionError(f"a tool twist has 6 columns but the actions have {actions.shape[1]}")
        if not np.isfinite(actions).all():
            raise PolicyActionError("ActionChunk actions should be finite but hold NaN or infinity")
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise PolicyActionError(f"ActionChunk dt should be above 0 s but is {self.dt}")
        actions.setflags(write=False)
        object.__setattr__(self, "actions", actions)
        if self.gripper_widths is not None:
            widths = np.array(self.gripper_widths, dtype=float)
            if widths.shape != (len(actions),) or not np.isfinite(widths).all():
                raise PolicyActionError(f"ActionChunk gripper_widths should be ({len(actions)},) and finite")
            object.__setattr__(self, "gripper_widths", widths)

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return len(self.actions) * self.dt


class Policy(ABC):
    """A learned policy, queried again after each executed chunk, or part of one."""

    @property
    @abstractmethod
    def specification(self) -> PolicySpecification:
        """The inputs and outputs; if the policy has a file, they can be read before loading or connecting."""

    @abstractmethod
    def reset(self) -> None:
        """Start a new episode; discard internal state."""

    @abstractmethod
    def act(self, observation: Observation) -> ActionChunk:
        """Return the next actions, as the specification describes them. Raises PolicyError."""

    def close(self) -> None:  # noqa: B027 - most policies hold nothing
        """Release files and connections; idempotent."""
