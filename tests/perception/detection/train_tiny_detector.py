"""Trains a detector of a few thousand weights on rendered tables, in numpy, and exports it as ONNX.

    python -m tests.perception.detection.train_tiny_detector FILE.onnx

It has the output of YOLO v8. A hidden layer tells the colours of 4 x 4 pixels apart (softmax, Adam); a convolution over
the resulting map of things regresses boxes and their middles (ridge regression).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
import onnx
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from benchmarks.rendered_table import RenderedTable, known_models, random_table
from bestman_bt.perception.detection.onnx_detector import letterbox

CLASSES = tuple(model.name for model in known_models(0))
SIZE = (320, 240)
CELL, KERNEL, HIDDEN = 4, 17, 16
COLUMNS, ROWS = SIZE[0] // CELL, SIZE[1] // CELL
BACKGROUND = len(CLASSES)


def training_scene(seed: int) -> RenderedTable:
    """Known objects in their own colours."""
    return random_table(seed, known=5, unknown=0, palette=0)


def train(seeds: Sequence[int], path: str) -> None:
    """Render the scenes of ``seeds``, fit the weights, write the file."""
    rng = np.random.default_rng(0)
    pictures, labels, boxes = zip(*(_example(training_scene(seed)) for seed in seeds), strict=True)
    hidden, output = _fit_colors(np.stack(pictures), np.stack(labels), rng)
    things = [1.0 - _probabilities(picture, hidden, output)[..., BACKGROUND] for picture in pictures]
    kernel = _fit_boxes(things, boxes)
    onnx.save(_network(hidden, output, kernel), path)


def true_boxes(scene: RenderedTable) -> list[tuple[str, NDArray[np.float64]]]:
    """Name and box (left, top, right, bottom), pixels, of each object that is not mostly hidden."""
    points, _, _ = scene.view.organised()
    found = []
    for item in scene.objects:
        local = item.pose.inverse().apply(points)
        inside = (np.abs(local) < item.model.size / 2 + 0.006).all(axis=-1) & (
            local[..., 2] > -item.model.size[2] / 2 + 0.01
        )
        rows, columns = np.nonzero(inside)
        if len(rows) > 150:
            found.append(
                (item.model.name, np.array([columns.min(), rows.min(), columns.max(), rows.max()], dtype=float))
            )
    return found


def _example(scene: RenderedTable) -> tuple[NDArray[np.float64], NDArray[np.int64], list[NDArray[np.float64]]]:
    """Mean colours (R, C, 3) and classes (R, C) of the cells, boxes in cells as centre and size."""
    picture, scale, shift = letterbox(scene.view.image.rgb, SIZE)
    cells = picture[0].astype(np.float64).reshape(3, ROWS, CELL, COLUMNS, CELL).mean(axis=(2, 4)).transpose(1, 2, 0)
    labels = np.full((ROWS, COLUMNS), BACKGROUND)
    points, _, _ = scene.view.organised()
    step = round(CELL / scale)
    middles = points[step // 2 :: step, step // 2 :: step]
    boxes = []
    for item in scene.objects:
        local = item.pose.inverse().apply(middles)
        inside = (np.abs(local) < item.model.size / 2 + 0.004).all(axis=-1) & (
            local[..., 2] > -item.model.size[2] / 2 + 0.01
        )
        labels[inside] = CLASSES.index(item.model.name)
    for _, box in true_boxes(scene):
        corners = ((box + 0.5).reshape(2, 2) * scale + shift) / CELL
        boxes.append(np.concatenate([corners.mean(axis=0), corners[1] - corners[0]]))
    return cells, labels, boxes


def _fit_colors(
    pictures: NDArray[np.float64], labels: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights (4, HIDDEN) and (HIDDEN + 1, classes + 1), the last row the bias."""
    colors, kinds = pictures.reshape(-1, 3), labels.reshape(-1)
    chosen = np.concatenate([rng.choice(np.flatnonzero(kinds == kind), 1500) for kind in np.unique(kinds)])
    x = np.column_stack([colors[chosen], np.ones(len(chosen))])
    target = np.eye(len(CLASSES) + 1)[kinds[chosen]]
    weights = [rng.normal(0.0, 2.0, (4, HIDDEN)), rng.normal(0.0, 0.5, (HIDDEN + 1, len(CLASSES) + 1))]
    first, second = ([np.zeros_like(w) for w in weights] for _ in range(2))
    for step in range(1, 401):
        h = np.column_stack([np.maximum(x @ weights[0], 0.0), np.ones(len(x))])
        error = (_softmax(h @ weights[1]) - target) / len(x)
        back = (error @ weights[1][:-1].T) * (h[:, :-1] > 0)
        for w, m, v, gradient in zip(weights, first, second, (x.T @ back, h.T @ error), strict=True):
            m += 0.1 * (gradient - m)
            v += 0.001 * (gradient**2 - v)
            w -= 0.05 * (m / (1 - 0.9**step)) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8)
    return weights[0], weights[1]


def _fit_boxes(
    things: Sequence[NDArray[np.float64]], boxes: Sequence[list[NDArray[np.float64]]]
) -> NDArray[np.float64]:
    """(KERNEL² + 1, 5): offset of the centre, size, both in cells, nearness of the centre; the last row the bias."""
    rows, columns = np.indices((ROWS, COLUMNS)) + 0.5
    inner, boxes_of_inner, everywhere, nearness = [], [], [], []
    for thing, found in zip(things, boxes, strict=True):
        windows = sliding_window_view(np.pad(thing, KERNEL // 2), (KERNEL, KERNEL)).reshape(ROWS, COLUMNS, -1)
        near = np.zeros((ROWS, COLUMNS))
        for x, y, width, height in found:
            inside = (np.abs(columns - x) < width / 2) & (np.abs(rows - y) < height / 2)
            dx, dy = x - columns[inside], y - rows[inside]
            near[inside] = np.maximum(near[inside], np.exp(-(dx**2 + dy**2) / 4.0))
            inner.append(windows[inside])
            boxes_of_inner.append(np.stack([dx, dy, np.full_like(dx, width), np.full_like(dx, height)], axis=1))
        # Walls have the colour of a cup: a middle has to be told from them, too.
        asked = thing > 0.2
        everywhere.append(windows[asked])
        nearness.append(near[asked][:, None])
    return np.concatenate([_ridge(inner, boxes_of_inner), _ridge(everywhere, nearness)], axis=1)


def _ridge(features: Sequence[NDArray[np.float64]], targets: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    a = np.concatenate(features)
    a = np.column_stack([a, np.ones(len(a))])
    return np.linalg.solve(a.T @ a + np.eye(a.shape[1]), a.T @ np.concatenate(targets))


def _probabilities(
    picture: NDArray[np.float64], hidden: NDArray[np.float64], output: NDArray[np.float64]
) -> NDArray[np.float64]:
    h = np.maximum(picture @ hidden[:3] + hidden[3], 0.0)
    return _softmax(h @ output[:-1] + output[-1])


def _softmax(values: NDArray[np.float64]) -> NDArray[np.float64]:
    raised = np.exp(values - values.max(axis=-1, keepdims=True))
    return raised / raised.sum(axis=-1, keepdims=True)


def _network(hidden: NDArray[np.float64], output: NDArray[np.float64], kernel: NDArray[np.float64]) -> onnx.ModelProto:
    count = len(CLASSES)
    columns, rows = np.meshgrid(np.arange(COLUMNS) + 0.5, np.arange(ROWS) + 0.5)
    constants = {
        "hidden_w": hidden[:3].T.reshape(HIDDEN, 3, 1, 1),
        "hidden_b": hidden[3],
        "output_w": output[:-1].T.reshape(count + 1, HIDDEN, 1, 1),
        "output_b": output[-1],
        "box_w": kernel[:-1].T.reshape(5, 1, KERNEL, KERNEL),
        "box_b": kernel[-1],
        "grid": np.stack([columns, rows])[None],
        "cell": np.array(float(CELL)),
        "half": np.array(0.5),
        "steep": np.array(8.0),
    }
    initial = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    initial += [
        numpy_helper.from_array(np.array(value, dtype=np.int64), name)
        for name, value in {"flat": (1, 4 + count, -1), "kinds": (count, 1), "parts": (2, 2, 1), "one": (1,)}.items()
    ]
    node = helper.make_node
    nodes = [
        node("AveragePool", ["images"], ["cells"], kernel_shape=[CELL, CELL], strides=[CELL, CELL]),
        node("Conv", ["cells", "hidden_w", "hidden_b"], ["before"]),
        node("Relu", ["before"], ["h"]),
        node("Conv", ["h", "output_w", "output_b"], ["logits"]),
        node("Softmax", ["logits"], ["probabilities"], axis=1),
        node("Split", ["probabilities", "kinds"], ["likely", "background"], axis=1),
        node("ReduceSum", ["likely", "one"], ["things"], keepdims=1),
        node("Conv", ["things", "box_w", "box_b"], ["regressed"], pads=[KERNEL // 2] * 4),
        node("Split", ["regressed", "parts"], ["offset", "extent", "nearness"], axis=1),
        node("Add", ["offset", "grid"], ["centre"]),
        node("Mul", ["centre", "cell"], ["centre_pixels"]),
        node("Mul", ["extent", "cell"], ["extent_pixels"]),
        node("Sub", ["nearness", "half"], ["nearer"]),
        node("Mul", ["nearer", "steep"], ["steeper"]),
        node("Sigmoid", ["steeper"], ["middle"]),
        node("Mul", ["likely", "middle"], ["scores"]),
        node("Concat", ["centre_pixels", "extent_pixels", "scores"], ["maps"], axis=1),
        node("Reshape", ["maps", "flat"], ["output0"]),
    ]
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, SIZE[1], SIZE[0]])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 4 + count, ROWS * COLUMNS])],
        initial,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    helper.set_model_props(model, {"names": str(dict(enumerate(CLASSES)))})
    onnx.checker.check_model(model)
    return model


if __name__ == "__main__":
    train(range(200, 208), sys.argv[1])
