"""Demonstrations of a policy's task on disk, in LeRobot's dataset layout."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import PolicyObservationError
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetError
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat, DatasetWriter


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One episode of N chunks: the observation before each, and the H actions after it.

    ``chunks``: (N, H, n) joint deltas, radians; (N, H, n + 1) with the gripper: +1 open, -1 closed.
    """

    observations: tuple[Observation, ...]
    chunks: NDArray[np.float64]


@dataclass(frozen=True)
class DemonstrationFormat:
    """The content of each frame.

    ``fps``: frames per second. ``joint_names``: n; ``gripper``: whether the gripper's width, metres, follows in state
    and action. ``goal_size``: entries of ``observation.goal``; 0: none. ``cameras``: name → (H, W) pixels, even.
    Raises DatasetError.
    """

    fps: int
    joint_names: tuple[str, ...]
    gripper: bool = False
    goal_size: int = 0
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    robot: str = ""
    dataset: DatasetFormat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.joint_names:
            raise DatasetError("joint_names should name at least one joint")
        if self.goal_size < 0:
            raise DatasetError(f"goal_size should be 0 or more, got {self.goal_size}")
        joints = (*self.joint_names, *(["gripper_width"] if self.gripper else []))
        goal = {"observation.goal": tuple(f"goal_{i}" for i in range(self.goal_size))} if self.goal_size else {}
        numbers = {"observation.state": joints, **goal, "action": joints}
        object.__setattr__(self, "dataset", DatasetFormat(self.fps, numbers, (), self.cameras, self.robot))


class DemonstrationRecorder(DatasetWriter):
    """A dataset whose frames are observations of a policy. Raises the errors of DatasetWriter, and
    PolicyObservationError for a frame that does not fit.
    """

    def __init__(self, folder: str | Path, frames: DemonstrationFormat) -> None:
        super().__init__(folder, frames.dataset)
        self.format = frames

    def add(self, observation: Observation, action: ArrayLike, gripper_command: float | None = None) -> None:
        """Add a frame: the observation, and the command: joint positions (n,) and the gripper's width."""
        widths = (observation.gripper_width, gripper_command) if self.format.gripper else ()
        if None in widths:
            raise PolicyObservationError("frames with a gripper need its width and its commanded width")
        given = np.array(widths, dtype=np.float32)
        joints = np.asarray(action, dtype=np.float32).reshape(-1)
        values = {
            "observation.state": np.append(observation.joint_positions, given[:1]),
            "observation.goal": observation.goal,
            "action": np.append(joints, given[1:]),
        }
        try:
            self.add_frame(values, observation.images)
        except DatasetError as error:
            raise PolicyObservationError(str(error)) from error
