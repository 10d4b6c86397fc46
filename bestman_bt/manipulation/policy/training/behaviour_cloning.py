"""Behaviour cloning: a small network, trained in numpy on demonstrations and written as an ONNX policy.

Pomerleau, "ALVINN", 1988; Adam: Kingma and Ba, 2015. Two hidden layers with SiLU (Elfwing et al., 2018), cosine decay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.errors import PolicyError
from bestman_bt.manipulation.policy.features import feature_vector
from bestman_bt.manipulation.policy.onnx_policy import PolicyCard, PolicyNormalization
from bestman_bt.manipulation.policy.specification import PolicySpecification
from bestman_bt.manipulation.policy.training.demonstrations import Demonstration
from bestman_bt.manipulation.policy.training.reaching import REACHING_FEATURES
from bestman_bt.messages.shapes import Count, Positive

Array = NDArray[np.float32]


@dataclass(frozen=True)
class BehaviourCloning:
    """Trains a network on demonstrations.

    ``hidden``: widths. ``steps``: number of Adam steps on batches of ``batch``, with ``rate`` decaying to 0 by a
    cosine. ``precision``: a chunk that moves a fraction s of the usual distance has the weight 1 / (s + precision), to
    emphasise the last centimetre.
    """

    hidden: tuple[int, ...] = (192, 192)
    steps: Count = 12000
    batch: Count = 256
    rate: Positive = 2e-3
    precision: Positive = 0.05
    seed: int = 0

    def train(
        self,
        demonstrations: Sequence[Demonstration],
        specification: PolicySpecification,
        features: Sequence[str] = REACHING_FEATURES,
    ) -> ClonedPolicy:
        """Train on all chunks of the demonstrations; equal input gives equal weights on one machine."""
        if not demonstrations:
            raise PolicyError("behaviour cloning needs at least one demonstration")
        seen = np.array([feature_vector(o, features) for d in demonstrations for o in d.observations])
        done = np.concatenate([d.chunks for d in demonstrations]).reshape(len(seen), -1)
        norm = PolicyNormalization(
            seen.mean(axis=0), seen.std(axis=0) + 1e-6, np.zeros(done.shape[1]), np.sqrt((done**2).mean(axis=0)) + 1e-6
        )
        inputs = ((seen - norm.input_mean) / norm.input_scale).astype(np.float32)
        targets = (done / norm.output_scale).astype(np.float32)
        moved = targets.reshape(len(seen), specification.horizon, -1)[:, :, : len(specification.joint_names)]
        weights = (1.0 / (np.sqrt((moved**2).mean(axis=(1, 2))) + self.precision)).astype(np.float32)
        layers, loss = self._fit(inputs, targets, weights / weights.mean())
        training = {"chunks": len(seen), "episodes": len(demonstrations), "loss": round(loss, 6), **asdict(self)}
        return ClonedPolicy(layers, PolicyCard(specification, tuple(features), norm, training), loss)

    def _fit(self, inputs: Array, targets: Array, weights: Array) -> tuple[tuple[tuple[Array, Array], ...], float]:
        rng = np.random.default_rng(self.seed)
        sizes = [inputs.shape[1], *self.hidden, targets.shape[1]]
        values: list[Array] = []
        for fan_in, fan_out in pairwise(sizes):
            values.append((rng.normal(size=(fan_in, fan_out)) * np.sqrt(1.6 / fan_in)).astype(np.float32))
            values.append(np.zeros(fan_out, dtype=np.float32))
        first = [np.zeros_like(value) for value in values]
        second = [np.zeros_like(value) for value in values]
        recent: list[float] = []
        for step in range(self.steps):
            rows = rng.integers(len(inputs), size=self.batch)
            loss, gradients = _gradients(values, inputs[rows], targets[rows], weights[rows])
            rate = self.rate * 0.5 * (1.0 + np.cos(np.pi * step / self.steps))
            corrected = np.float32(rate * np.sqrt(1.0 - 0.999 ** (step + 1)) / (1.0 - 0.9 ** (step + 1)))
            for value, m, v, gradient in zip(values, first, second, gradients, strict=True):
                m += np.float32(0.1) * (gradient - m)
                v += np.float32(0.001) * (gradient * gradient - v)
                value -= corrected * m / (np.sqrt(v) + np.float32(1e-8))
            recent = [*recent[-99:], loss]
        layers = tuple((values[i], values[i + 1]) for i in range(0, len(values), 2))
        return layers, float(np.mean(recent))


@dataclass(frozen=True, eq=False)
class ClonedPolicy:
    """A trained network: ``layers`` of weights (in, out) and biases (out,), and its card.

    ``loss``: weighted mean square over the last hundred batches.
    """

    layers: tuple[tuple[Array, Array], ...]
    card: PolicyCard
    loss: float

    def save(self, path: Path) -> None:
        """Write ``path`` (.onnx) and its .json. Raises MissingExtraError without the package onnx."""
        try:
            import onnx
            from onnx import TensorProto, helper, numpy_helper
        except ImportError as error:
            raise MissingExtraError(f"writing policies needs onnx: {install_command('policy')}") from error
        nodes, weights, value = [], [], "features"
        for i, (weight, bias) in enumerate(self.layers):
            last = i == len(self.layers) - 1
            weights += [numpy_helper.from_array(weight, f"w{i}"), numpy_helper.from_array(bias, f"b{i}")]
            out = "chunk" if last else f"z{i}"
            nodes.append(helper.make_node("Gemm", [value, f"w{i}", f"b{i}"], [out]))
            if not last:
                nodes.append(helper.make_node("Sigmoid", [out], [f"s{i}"]))
                nodes.append(helper.make_node("Mul", [out, f"s{i}"], [f"a{i}"]))
                value = f"a{i}"
        sizes = self.layers[0][0].shape[0], self.layers[-1][0].shape[1]
        graph = helper.make_graph(
            nodes,
            "policy",
            [helper.make_tensor_value_info("features", TensorProto.FLOAT, [1, sizes[0]])],
            [helper.make_tensor_value_info("chunk", TensorProto.FLOAT, [1, sizes[1]])],
            weights,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        onnx.checker.check_model(model)
        path.parent.mkdir(parents=True, exist_ok=True)
        onnx.save(model, str(path))
        self.card.write(path.with_suffix(".json"))


def _gradients(values: list[Array], inputs: Array, targets: Array, weights: Array) -> tuple[float, list[Array]]:
    """Return the weighted mean square error and its gradients, in the order of ``values``."""
    activations, slopes, count = [inputs], [], len(values) // 2
    for layer in range(count - 1):
        z = activations[-1] @ values[2 * layer] + values[2 * layer + 1]
        gate = expit(z)
        activations.append(z * gate)
        slopes.append(gate * (1.0 + z * (1.0 - gate)))
    error = activations[-1] @ values[-2] + values[-1] - targets
    loss = float((weights[:, None] * error**2).mean())
    delta = np.float32(2.0 / error.size) * weights[:, None] * error
    gradients: list[Array] = [delta] * len(values)
    for layer in range(count - 1, -1, -1):
        gradients[2 * layer] = activations[layer].T @ delta
        gradients[2 * layer + 1] = delta.sum(axis=0)
        if layer:
            delta = (delta @ values[2 * layer].T) * slopes[layer - 1]
    return loss, gradients
