"""Detectors in ONNX files with the output of YOLO v8: boxes and class scores, run by onnxruntime on the CPU.

The layout is that of ``yolo export format=onnx``: input [1, 3, H, W], RGB, 0 to 1; output [1, 4 + C, N] with the boxes'
centres and sizes in pixels of the input and C scores each, 0 to 1. The picture is letterboxed, as in training.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.messages import RGBDImage
from bestman_bt.perception.detection.from_image import FromImage, ImageDetection
from bestman_bt.perception.errors import DetectorModelError

_GREY = 114


@dataclass(frozen=True)
class OnnxDetector(FromImage):
    """Detects objects with a detector in an ONNX file.

    The file is read by ``prepare``, or else at the first image. Raises MissingExtraError without onnxruntime and
    DetectorModelError if the file does not have the expected format.

    ``model``: the .onnx file. ``classes``: its classes in order; empty: those in its metadata ``names``.
    ``input_size``: (width, height) pixels, if the file leaves them open. ``max_overlap``: intersection over union above
    which the detection with the lower score of the same class is dropped. ``threads``: of onnxruntime.
    """

    model: str = ""
    classes: tuple[str, ...] = ()
    input_size: Annotated[tuple[int, int], "pixels"] = (640, 640)
    max_overlap: float = 0.5
    threads: int = 1

    @cached_property
    def _network(self) -> _Network:
        return _Network(self)

    def prepare(self) -> None:
        """Read the file."""
        _ = self._network

    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        """Return the detections of ``names`` in the image; other classes are omitted. See ``FromImage.find``."""
        network = self._network
        wanted = np.array([name in names for name in network.classes])
        if not wanted.any() or image.rgb.size == 0:
            return ()
        picture, scale, shift = letterbox(image.rgb, network.size)
        output = network.run(picture)
        scores = np.where(wanted[:, None], output[4:], 0.0)
        kind, score = scores.argmax(axis=0), scores.max(axis=0)
        likely = np.isfinite(output).all(axis=0) & (score >= self.min_score) & (output[2:4] > 0.0).all(axis=0)
        boxes, kind, score = output[:4, likely].T.astype(np.float64), kind[likely], score[likely]
        # Letterboxed pixels are counted from the corner of the first, ours from its centre.
        centre, extent = (boxes[:, :2] - shift) / scale - 0.5, boxes[:, 2:] / scale
        corners = np.concatenate([centre - extent / 2, extent], axis=1)
        kept = cv2.dnn.NMSBoxesBatched(
            corners.tolist(), score.astype(float).tolist(), kind.tolist(), self.min_score, self.max_overlap
        )
        found = []
        for index in np.asarray(kept, dtype=np.intp).reshape(-1):
            left, top, width, height = (float(value) for value in corners[index])
            box = (left, top, left + width, top + height)
            detection = ImageDetection(network.classes[kind[index]], min(1.0, float(score[index])), box)
            clipped = detection.clipped(image.intrinsics.width, image.intrinsics.height)
            if clipped is not None:
                found.append(clipped)
        return tuple(sorted(found, key=lambda detection: -detection.score))


def letterbox(rgb: NDArray[np.uint8], size: tuple[int, int]) -> tuple[NDArray[np.float32], float, NDArray[np.float64]]:
    """Return the picture (1, 3, H, W), 0 to 1, scaled to fit into ``size`` (width, height) and centred on grey.

    Also the scale, and (x, y) of the picture's corner in it: pixel = (letterboxed - corner) / scale.
    """
    height, width = rgb.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    inner = max(1, round(width * scale)), max(1, round(height * scale))
    canvas = np.full((size[1], size[0], 3), _GREY, dtype=np.uint8)
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    resized = rgb if inner == (width, height) else cv2.resize(rgb, inner, interpolation=cv2.INTER_LINEAR)
    canvas[top : top + inner[1], left : left + inner[0]] = resized
    picture = np.ascontiguousarray(canvas.transpose(2, 0, 1)[None].astype(np.float32) / 255.0)
    return picture, scale, np.array([left, top], dtype=np.float64)


class _Network:
    """The file, checked: ``size`` (width, height) of its input, ``classes`` in order."""

    def __init__(self, p: OnnxDetector) -> None:
        path = Path(p.model)
        if not p.model or not path.is_file():
            raise DetectorModelError(f"no ONNX file {p.model!r}; give its path as 'model' of detection/onnx")
        try:
            import onnxruntime
        except ImportError as error:
            raise MissingExtraError(f"detection/onnx needs onnxruntime: {install_command('onnx')}") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = p.threads
        options.log_severity_level = 3
        try:
            session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors share no narrower class
            raise DetectorModelError(f"{path} is not an ONNX model that onnxruntime can load: {error}") from error
        self._session, self._path = session, path
        self.size = self._input_size(session.get_inputs(), p)
        self.classes = p.classes or _named_classes(session)
        if not self.classes:
            raise DetectorModelError(f"{path} does not name its classes; give them as 'classes' of detection/onnx")

    def run(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the output (4 + C, N) for a picture (1, 3, H, W)."""
        name = self._session.get_inputs()[0].name
        try:
            outputs = self._session.run(None, {name: picture})
        except Exception as error:  # onnxruntime's errors share no narrower class
            raise DetectorModelError(f"{self._path} fails on a picture {picture.shape}: {error}") from error
        rows = 4 + len(self.classes)
        output: NDArray[np.float32] = np.asarray(outputs[0])
        if len(outputs) != 1 or output.ndim != 3 or output.shape[:2] != (1, rows):
            found = ", ".join(str(np.asarray(item).shape) for item in outputs)
            raise DetectorModelError(
                f"{self._path} gives {found}; with {len(self.classes)} classes one output (1, {rows}, N) is expected: "
                "the layout of YOLO v8 without masks"
            )
        return np.asarray(output[0], dtype=np.float32)

    def _input_size(self, inputs: Sequence[Any], p: OnnxDetector) -> tuple[int, int]:
        shape = list(inputs[0].shape) if inputs else []
        fits = len(inputs) == 1 and len(shape) == 4 and shape[1] == 3 and inputs[0].type == "tensor(float)"
        if not fits or (isinstance(shape[0], int) and shape[0] != 1):
            found = ", ".join(f"{item.type} {list(item.shape)}" for item in inputs)
            raise DetectorModelError(f"{self._path} takes {found}; one input tensor(float) [1, 3, H, W] is expected")
        height, width = shape[2:]
        return (
            width if isinstance(width, int) else p.input_size[0],
            height if isinstance(height, int) else p.input_size[1],
        )


def _named_classes(session: Any) -> tuple[str, ...]:
    """Return the classes in the metadata, written as exporters do: {0: 'cup', 1: 'can'}."""
    text = session.get_modelmeta().custom_metadata_map.get("names", "")
    try:
        names = ast.literal_eval(text) if text else {}
    except (ValueError, SyntaxError):
        return ()
    if isinstance(names, (list, tuple)):
        return tuple(str(name) for name in names)
    return tuple(str(names[key]) for key in sorted(names)) if isinstance(names, dict) else ()
