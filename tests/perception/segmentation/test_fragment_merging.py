"""Which pieces of a picture are one thing."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.perception.segmentation.region_growing import FragmentMerging, merge_fragments


@pytest.mark.parametrize(("last_row", "things"), [(30, 1), (36, 2), (39, 2)])
def test_a_piece_whose_lower_end_the_picture_cuts_off_may_stand_there_and_does_not_hang(
    last_row: int, things: int
) -> None:
    """Two pieces side by side whose lowest points that are seen lie 3 cm above the surface."""
    labels = np.zeros((40, 40), dtype=np.int32)
    labels[10 : last_row + 1, 5:15], labels[10 : last_row + 1, 15:25] = 1, 2
    rows, columns = np.indices(labels.shape)
    local = np.stack([0.005 * columns, np.zeros((40, 40)), 0.03 + 0.005 * (last_row - rows)], axis=-1)
    depth = np.where(labels > 0, np.float32(1.0), np.float32(0.0))
    merged = merge_fragments(labels, local, depth, np.array([0.1, -1.0, 0.5]), FragmentMerging())
    assert merged.max() == things
