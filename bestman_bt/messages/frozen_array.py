"""Arrays of frozen messages: checked once, then read-only."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


def frozen_array(
    values: ArrayLike, shape: tuple[int | None, ...], what: str, dtype: DTypeLike = np.float64
) -> NDArray[Any]:
    """Return ``values`` as a read-only array of ``dtype``; a read-only array is not copied.

    ``shape``: the expected shape; None allows any length. Raises ValueError naming ``what`` and the actual shape.
    """
    array = np.asarray(values, dtype=dtype)
    if array.shape != shape and not _fits(array.shape, shape):
        expected = "(" + ", ".join("N" if extent is None else str(extent) for extent in shape) + ")"
        raise ValueError(f"{what} should have shape {expected} but has {array.shape}")
    if array.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


def _fits(found: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(found) == len(expected) and all(
        want is None or have == want for have, want in zip(found, expected, strict=True)
    )
