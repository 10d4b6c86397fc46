"""Recorded views of a calibration board: a folder with images and a ``dataset.yaml`` that describes them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.configuration.quantity import (
    Angles3,
    Factor,
    JointPosition,
    Lengths3,
    LensDistortion,
    Number,
    PositiveLength,
    WholeNumber,
)
from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import Board, BoardSighting, CalibrationError, CharucoBoard, Checkerboard

FILE = "dataset.yaml"
Progress = Callable[[str, int, int], None]
"""Called with the current step, the number of finished items and their total."""


@dataclass(frozen=True)
class BoardConfig:
    """A board of ``columns`` × ``rows`` squares of edge ``square``; ChArUco boards have markers of edge ``marker``."""

    kind: Literal["charuco", "checkerboard"]
    columns: WholeNumber
    rows: WholeNumber
    square: PositiveLength
    marker: PositiveLength | None = None
    dictionary: str = "DICT_4X4_50"


@dataclass(frozen=True)
class PoseConfig:
    """A pose: ``xyz``, metres, and ``rpy`` (URDF, radians) or ``quaternion`` (xyzw)."""

    xyz: Lengths3
    rpy: Angles3 | None = None
    quaternion: tuple[Number, Number, Number, Number] | None = None


@dataclass(frozen=True)
class LensConfig:
    """Known intrinsics, pixels; they replace those of the robot's camera."""

    focal_length: tuple[Factor, Factor]
    principal_point: tuple[Number, Number]
    distortion: LensDistortion = ()


@dataclass(frozen=True)
class ViewConfig:
    """One view. ``image``: colour, ``depth``: 16 bits; paths relative to this file. ``joints``: joint → position.

    ``hand``: the pose of the hand in the base, if no robot model can compute it from ``joints``.
    """

    image: str
    depth: str | None = None
    joints: Mapping[str, JointPosition] = field(default_factory=dict)
    hand: PoseConfig | None = None


@dataclass(frozen=True)
class DatasetConfig:
    """Views of a board by one camera. ``robot``: the robot that their ``joints`` refer to; without one, ``setup``
    states whether the hand carries camera or board.

    ``camera``: its name in the robot. ``board_on``: the robot's link that carries the board; without it the board is
    fixed, at ``board_pose`` in the robot's base if measured. ``depth_unit``: metres per unit of depth.
    """

    board: BoardConfig
    views: tuple[ViewConfig, ...]
    camera: str = "camera"
    robot: str | None = None
    setup: Literal["eye_in_hand", "eye_to_hand"] = "eye_in_hand"
    board_on: str | None = None
    board_pose: PoseConfig | None = None
    intrinsics: LensConfig | None = None
    depth_unit: PositiveLength = 0.001


@dataclass(frozen=True, eq=False)
class RecordedView:
    """One view: the ``index`` of its entry, corners (None: board not seen), depth (H, W) metres, if any."""

    index: int
    name: str
    sighting: BoardSighting | None
    depth: NDArray[np.float32] | None


@dataclass(frozen=True, eq=False)
class Dataset:
    """A checked dataset; ``document`` holds the line numbers. Images are read on demand."""

    folder: Path
    config: DatasetConfig
    document: Document
    board: Board

    def intrinsics(self, size: tuple[int, int]) -> CameraIntrinsics | None:
        """Return the intrinsics stated in the dataset for images of ``size`` (width, height) pixels, or None."""
        known = self.config.intrinsics
        if known is None:
            return None
        return CameraIntrinsics(*size, *known.focal_length, *known.principal_point, known.distortion)

    def read(self, progress: Progress) -> tuple[tuple[RecordedView, ...], tuple[int, int]]:
        """Return all views with the detected board, and the size (width, height) of the images in pixels.

        Raises ConfigurationError for a file that is not an image, or has another size than the first.
        """
        views: list[RecordedView] = []
        problems: list[Problem] = []
        size: tuple[int, int] | None = None
        for index, view in enumerate(self.config.views):
            progress("finding the board", index, len(self.config.views))
            bgr = cv2.imread(str(self.folder / view.image), cv2.IMREAD_COLOR)
            if bgr is None:
                problems.append(self.document.problem(("views", index, "image"), f"{view.image} is not an image"))
                continue
            here = (bgr.shape[1], bgr.shape[0])
            size = size or here
            if here != size:
                message = f"{view.image} has {here[0]} × {here[1]} pixels, the first image {size[0]} × {size[1]}"
                problems.append(self.document.problem(("views", index, "image"), message))
                continue
            rgb = np.ascontiguousarray(np.asarray(bgr, dtype=np.uint8)[..., ::-1])
            depth, fault = self._depth(view, here)
            if fault:
                problems.append(self.document.problem(("views", index, "depth"), fault))
            views.append(RecordedView(index, Path(view.image).stem, self.board.find(rgb), depth))
        progress("finding the board", len(self.config.views), len(self.config.views))
        if problems or size is None:
            raise ConfigurationError(problems)
        return tuple(views), size

    def _depth(self, view: ViewConfig, size: tuple[int, int]) -> tuple[NDArray[np.float32] | None, str]:
        if view.depth is None:
            return None, ""
        steps = cv2.imread(str(self.folder / view.depth), cv2.IMREAD_UNCHANGED)
        if steps is None or steps.ndim != 2 or steps.dtype != np.uint16:
            return None, f"{view.depth} is not an image with 16 bits and one channel"
        if (steps.shape[1], steps.shape[0]) != size:
            return None, f"{view.depth} has {steps.shape[1]} × {steps.shape[0]} pixels, its colour image others"
        return (steps * self.config.depth_unit).astype(np.float32), ""


def load_dataset(folder: Path) -> Dataset:
    """Read and check ``folder/dataset.yaml``.

    Raises ConfigurationError listing every fault with its line.
    """
    document = read_document(folder / FILE)
    config, problems = salvage(document, DatasetConfig)
    if document.data.get("views") == []:
        problems.append(document.problem(("views",), "holds no views"))
    with suppress(UnreadError):
        for index, view in numbered(config.views):
            problems += _view_faults(view, index, document, folder)
    if config.board_on is not None and config.robot is None and "robot" not in document.data:
        problems.append(document.problem(("board_on",), "names a link, and 'robot' is missing"))
    faults = ProblemCollector(problems)
    with faults.step():
        board = _board(config.board, document)
    faults.raise_if_any()
    return Dataset(folder, config, document, board)


@up_to_unread_field
def _view_faults(view: ViewConfig, index: int, document: Document, folder: Path) -> Iterator[Problem]:
    if view.hand is not None and (view.hand.rpy is None) == (view.hand.quaternion is None):
        yield document.problem(("views", index, "hand"), "either 'rpy' or 'quaternion' should be given")
    for what in ("depth", "image"):
        name = getattr(view, what)
        if name is not None and not (folder / name).is_file():
            yield document.problem(("views", index, what), f"no such file: {folder / name}")


def pose_of(config: PoseConfig) -> Pose:
    """Return the pose of a config; without ``rpy`` and ``quaternion`` the rotation is the identity."""
    if config.quaternion is not None:
        return Pose(np.array(config.xyz), Rotation.from_quat(config.quaternion).as_quat())
    return Pose.from_xyz_rpy(config.xyz, config.rpy or (0.0, 0.0, 0.0))


def _board(config: BoardConfig, document: Document) -> Board:
    try:
        if config.kind == "checkerboard":
            return Checkerboard(config.columns, config.rows, config.square)
        if config.marker is None:
            message = "'marker' is missing: the edge of a marker"
            raise ConfigurationError([document.problem(("board",), message)])
        return CharucoBoard(config.columns, config.rows, config.square, config.marker, config.dictionary)
    except CalibrationError as error:
        raise ConfigurationError([document.problem(("board",), str(error))]) from error
