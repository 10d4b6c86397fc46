"""The black box: commands and measurements of all parts in the seconds before a stop, as a file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import Error

PATTERN = "black_box_*.npz"
"""Names of the files in a run folder."""
MAX_BYTES = 500_000_000
ABOUT = "about"


class BlackBoxError(Error):
    """A file is not a black box, or is damaged."""


@dataclass(frozen=True, eq=False)
class PartTrace:
    """The trace of one part. ``times`` (N,): seconds of the robot's clock. ``values`` (N, C): by ``columns``; SI units,
    radians.

    A column is named by quantity and joint: ``set position arm_joint1``, ``measured width``. ``reasons``: the times at
    which the gate began to hold back set-points, each with the reason; an empty reason marks its end.
    """

    times: NDArray[np.float64]
    values: NDArray[np.float32]
    columns: tuple[str, ...]
    reasons: tuple[tuple[float, str], ...] = ()

    def of(self, column: str) -> NDArray[np.float32]:
        """Return the values (N,) of a column. Raises KeyError for an unknown column."""
        if column not in self.columns:
            raise KeyError(column)
        values: NDArray[np.float32] = self.values[:, self.columns.index(column)]
        return values


@dataclass(frozen=True, eq=False)
class BlackBox:
    """The last seconds before a stop or a failed motion. ``stopped_at``: its time by the robot's clock, seconds.
    ``reason``: why; ``parts``: by name.
    """

    stopped_at: float
    reason: str
    parts: Mapping[str, PartTrace]

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file that can be read with numpy alone."""
        about = {
            "stopped_at": self.stopped_at,
            "reason": self.reason,
            "parts": {name: {"columns": part.columns, "reasons": part.reasons} for name, part in self.parts.items()},
        }
        arrays: dict[str, Any] = {ABOUT: np.frombuffer(json.dumps(about).encode(), np.uint8)}
        for name, part in self.parts.items():
            arrays[f"{name}/times"], arrays[f"{name}/values"] = part.times, part.values
        unfinished = path.with_suffix(".part")
        with unfinished.open("wb") as file:
            np.savez(file, **arrays)
        unfinished.replace(path)

    @staticmethod
    def load(path: Path) -> BlackBox:
        """Read a file that ``save`` wrote. Raises BlackBoxError if it is not a black box, damaged or too large."""
        try:
            if path.stat().st_size > MAX_BYTES:
                raise BlackBoxError(f"{path.name} has more than {MAX_BYTES} bytes")
            with np.load(path, allow_pickle=False) as arrays:
                about = json.loads(arrays[ABOUT].tobytes())
                parts = {}
                for name, told in about["parts"].items():
                    times, values = arrays[f"{name}/times"], arrays[f"{name}/values"]
                    columns = tuple(str(column) for column in told["columns"])
                    if times.ndim != 1 or values.shape != (len(times), len(columns)):
                        raise ValueError(f"{name} has {values.shape} values for {len(times)} times")
                    reasons = tuple((float(time), str(text)) for time, text in told["reasons"])
                    parts[str(name)] = PartTrace(times, values, columns, reasons)
                return BlackBox(float(about["stopped_at"]), str(about["reason"]), parts)
        except (OSError, KeyError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
            raise BlackBoxError(f"{path.name} is not a black box: {type(error).__name__}: {error}") from error
