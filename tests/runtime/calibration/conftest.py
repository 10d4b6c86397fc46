from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CharucoBoard
from tests.perception.calibration.recorded import CAMERA, photographed, target_before_the_eye, turned

BOARD = CharucoBoard(7, 5, 0.03, 0.0225)
HAND_FROM_EYE = Pose.from_xyz_rpy((0.05, -0.02, 0.08), (0.1, -0.2, math.radians(95)))
BASE_FROM_BOARD = Pose.from_xyz_rpy((0.6, 0.05, 0.3), (math.pi, 0.2, 0.3))
DOCUMENT: dict[str, Any] = {
    "camera": "my_camera",
    "board": {"kind": "charuco", "columns": 7, "rows": 5, "square": "30 mm", "marker": "22.5 mm"},
    "intrinsics": {"focal_length": [CAMERA.fx, CAMERA.fy], "principal_point": [CAMERA.cx, CAMERA.cy]},
}


def written_pose(pose: Pose) -> dict[str, list[float]]:
    return {"xyz": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}


@pytest.fixture(scope="session")
def photographs() -> list[tuple[np.ndarray, Pose]]:
    """Pictures of the board from eight places, with eye_from_board."""
    rng = np.random.default_rng(11)
    middle = Pose(-np.array([*BOARD.size, 0.0]) / 2)
    poses = [target_before_the_eye(rng) @ turned(np.zeros(3)) @ middle for _ in range(8)]
    return [(photographed(BOARD.picture(64), 64 / 0.03, pose), pose) for pose in poses]


@pytest.fixture
def dataset(tmp_path: Path, photographs) -> Callable[..., Path]:
    """A folder with images and ``dataset.yaml``: of a camera on a hand, or beside a hand that carries the board."""

    def write(setup: str = "eye_in_hand", **changes: Any) -> Path:
        entries = []
        for index, (image, eye_from_board) in enumerate(photographs):
            cv2.imwrite(str(tmp_path / f"{index}.png"), image)
            if setup == "eye_in_hand":
                hand = BASE_FROM_BOARD @ eye_from_board.inverse() @ HAND_FROM_EYE.inverse()
            else:  # the same numbers: the camera stands at HAND_FROM_EYE in the base, the board is on the hand
                hand = HAND_FROM_EYE @ eye_from_board @ BASE_FROM_BOARD.inverse()
            entries.append({"image": f"{index}.png", "hand": written_pose(hand)})
        document = {**DOCUMENT, "setup": setup, "views": entries, **changes}
        (tmp_path / "dataset.yaml").write_text(yaml.safe_dump(document))
        return tmp_path

    return write
