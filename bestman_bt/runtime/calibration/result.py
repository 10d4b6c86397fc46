"""The result of a calibration: a document for a robot file, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """``parts``: settings that override a robot's parts. ``figures``: standard deviations, covariance, offsets, for
    people.

    ``views``: names of the used views; ``errors``: root mean square reprojection error of each, pixels; ``offsets``:
    (N, 2) pixels, of each view's corners. ``notes``: what was left out, in words.
    """

    kind: str
    robot: str | None
    camera: str
    recorded: int
    views: tuple[str, ...]
    errors: NDArray[np.float64]
    offsets: tuple[NDArray[np.float64], ...]
    parts: Mapping[str, Mapping[str, Any]]
    figures: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """Root mean square reprojection error of all corners, pixels."""
        squares = np.concatenate([np.sum(offset**2, axis=1) for offset in self.offsets])
        return float(np.sqrt(np.mean(squares)))

    def to_document(self) -> dict[str, Any]:
        """Return the result as plain values; equal results give equal text."""
        worst = int(np.argmax(self.errors))
        document: dict[str, Any] = {
            "kind": self.kind,
            "robot": self.robot,
            "camera": self.camera,
            "parts": self.parts,
            "views": {"recorded": self.recorded, "used": len(self.views)},
            "reprojection_px": {
                "rms": self.error,
                "worst": {self.views[worst]: float(self.errors[worst])},
                "per_view": dict(zip(self.views, self.errors.tolist(), strict=True)),
            },
            **self.figures,
        }
        if self.notes:
            document["notes"] = list(self.notes)
        return {key: _plain(value) for key, value in document.items() if value is not None}

    def write(self, path: Path) -> None:
        """Write the document as YAML."""
        text = yaml.safe_dump(
            self.to_document(), sort_keys=False, allow_unicode=True, default_flow_style=None, width=118
        )
        path.write_text(text, encoding="utf-8")


def deviations(covariance: NDArray[np.float64]) -> dict[str, list[float]]:
    """Return the standard deviations of a pose from its covariance (6, 6), m and rad: millimetres and degrees."""
    roots = np.sqrt(np.diag(covariance))
    return {"position_mm": (1e3 * roots[:3]).tolist(), "rotation_deg": np.degrees(roots[3:]).tolist()}


def _plain(value: Any) -> Any:
    """Return numbers rounded to seven digits, so that equal calibrations give equal files on all machines."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.7g}")
    return value
