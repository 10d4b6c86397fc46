"""Policies in ONNX files, run by onnxruntime on the CPU; a JSON file of the same name specifies inputs and outputs.

The network takes normalised features [1, f] and returns a normalised chunk [1, H · n], or [1, H · (n + 1)] with the
gripper: above 0 open, else closed.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyActionError, PolicyModelError, PolicyObservationError
from bestman_bt.manipulation.policy.features import feature_vector
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification


@dataclass(frozen=True, eq=False)
class PolicyNormalization:
    """Features are shifted by ``input_mean`` and divided by ``input_scale``, both (f,); outputs inversely."""

    input_mean: NDArray[np.float64]
    input_scale: NDArray[np.float64]
    output_mean: NDArray[np.float64]
    output_scale: NDArray[np.float64]

    def to_dict(self) -> dict[str, list[float]]:
        """Return plain values for JSON."""
        return {name: getattr(self, name).tolist() for name in self.__dataclass_fields__}

    @classmethod
    def from_dict(cls, values: Any) -> PolicyNormalization:
        """Return the normalisation from the output of ``to_dict``. Raises PolicyModelError for wrong shapes or a scale
        ≤ 0."""
        try:
            arrays = {name: np.array(values[name], dtype=float) for name in cls.__dataclass_fields__}
        except (KeyError, TypeError, ValueError) as error:
            raise PolicyModelError(f"this is not a normalisation: {error!r}") from error
        result = cls(**arrays)
        for side in ("input", "output"):
            mean, scale = arrays[f"{side}_mean"], arrays[f"{side}_scale"]
            if mean.ndim != 1 or mean.shape != scale.shape or not np.isfinite(mean).all() or not (scale > 0).all():
                raise PolicyModelError(
                    f"{side}_mean and {side}_scale should be finite and of equal length, with scales above 0"
                )
        return result


@dataclass(frozen=True, eq=False)
class PolicyCard:
    """The JSON file beside the network: specification, input features, normalisation, and training data."""

    specification: PolicySpecification
    features: tuple[str, ...]
    normalization: PolicyNormalization
    training: dict[str, Any] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write the file."""
        content = {
            "specification": self.specification.to_dict(),
            "features": list(self.features),
            "normalization": self.normalization.to_dict(),
            "training": self.training,
        }
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> PolicyCard:
        """Read the file. Raises PolicyModelError if it is missing or invalid."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            return cls(
                PolicySpecification.from_dict(content["specification"]),
                tuple(content["features"]),
                PolicyNormalization.from_dict(content["normalization"]),
                dict(content.get("training", {})),
            )
        except KeyError as error:
            raise PolicyModelError(f"{path} does not describe a policy: {error} is missing") from error
        except (OSError, UnicodeDecodeError, json.JSONDecodeError, TypeError, PolicyModelError) as error:
            raise PolicyModelError(f"{path} does not describe a policy: {error}") from error


@dataclass(frozen=True)
class OnnxPolicy(Policy):
    """Returns the network's chunk, converted to radians; stateless.

    The specification is read on first use, the network at the first ``act``. Raises MissingExtraError without
    onnxruntime, PolicyModelError for inconsistent files, PolicyActionError for NaN. ``model``: the .onnx file; its
    specification is the .json beside it. ``threads``: number of threads of onnxruntime.
    """

    model: str = ""
    threads: int = 1

    @property
    def _path(self) -> Path:
        return Path(self.model)

    @cached_property
    def card(self) -> PolicyCard:
        """The card of the network. Raises PolicyModelError."""
        if not self.model or not self._path.is_file():
            raise PolicyModelError(f"no ONNX file {self.model!r}; give its path as 'model' of policy/onnx")
        card = PolicyCard.read(self._path.with_suffix(".json"))
        spec, outputs = card.specification, len(card.normalization.output_mean)
        spaces = (ActionSpace.JOINT_POSITIONS.value, ActionSpace.JOINT_DELTAS.value)
        columns = len(spec.joint_names) + spec.moves_gripper
        if spec.space not in spaces or outputs != spec.horizon * columns or outputs == 0:
            raise PolicyModelError(
                f"{self._path} should give {spec.horizon} x {columns} joint actions "
                f"but is described as {outputs} numbers of {spec.space!r}"
            )
        return card

    @property
    def specification(self) -> PolicySpecification:
        """Implement ``Policy.specification``."""
        return self.card.specification

    def reset(self) -> None:
        """Do nothing: the policy is stateless."""

    def act(self, observation: Observation) -> ActionChunk:
        """Return the network's chunk. Raises PolicyObservationError or PolicyModelError."""
        spec, norm = self.specification, self.card.normalization
        if observation.joint_positions.shape != (len(spec.joint_names),):
            raise PolicyObservationError(
                f"{self._path} moves {len(spec.joint_names)} joints, "
                f"the observation has {observation.joint_positions.shape}"
            )
        features = feature_vector(observation, self.card.features)
        if features.shape != norm.input_mean.shape:
            raise PolicyModelError(f"{self._path} takes {norm.input_mean.shape} features, these are {features.shape}")
        raw = self.run(((features - norm.input_mean) / norm.input_scale).astype(np.float32)[None])
        chunk = (raw * norm.output_scale + norm.output_mean).reshape(spec.horizon, -1)
        joints, space = len(spec.joint_names), ActionSpace(spec.space)
        if not spec.moves_gripper:
            return ActionChunk(chunk, spec.dt, space)
        widths = np.where(chunk[:, joints] > 0.0, spec.open_width, 0.0)
        return ActionChunk(chunk[:, :joints], spec.dt, space, widths)

    def run(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the network's outputs for normalized ``features`` (1, n); raises the errors of ``act``."""
        session = self._session
        try:
            outputs = session.run(None, {session.get_inputs()[0].name: features})
        except Exception as error:  # onnxruntime's errors share no narrower class
            raise PolicyModelError(f"{self._path} fails on features {features.shape}: {error}") from error
        raw = np.asarray(outputs[0], dtype=np.float64)
        expected = (1, len(self.card.normalization.output_mean))
        if len(outputs) != 1 or raw.shape != expected:
            found = ", ".join(str(np.asarray(item).shape) for item in outputs)
            raise PolicyActionError(f"{self._path} gives {found}; one output {expected} is expected")
        if not np.isfinite(raw).all():
            raise PolicyActionError(f"{self._path} gives NaN or infinity")
        chunk: NDArray[np.float64] = raw[0]
        return chunk

    @cached_property
    def _session(self) -> Any:
        try:
            import onnxruntime
        except ImportError as error:
            raise MissingExtraError(f"policy/onnx needs onnxruntime: {install_command('onnx')}") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = self.threads
        options.log_severity_level = 3
        try:
            return onnxruntime.InferenceSession(str(self._path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors share no narrower class
            raise PolicyModelError(f"{self._path} is not an ONNX model that onnxruntime can load: {error}") from error
