"""What the pads meet when the hand closes: how wide, how flat, how well opposed, found from points with normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.grasp_pose.hand_poses import HandPoses


@dataclass(frozen=True, eq=False)
class PadContacts:
    """For each of K hands, (K,) each; ``width`` is 0 where a pad meets nothing.

    ``centre``: middle between the contacts, (K, 3) in the tool frame. ``alignment``: cosine between closing direction
    and mean normal of the patch, at the worse side. ``extent``: (K, 2) how far the smaller patch spreads across and
    along the pads, metres (standard deviation). ``offset``: metres between the patches, along the pads' faces.
    ``bulge``: metres by which the object is wider further up between the fingers than at the pads.
    ``seen``: share of the samples in the patches that were measured, at the worse side.
    """

    width: NDArray[np.float64]
    centre: NDArray[np.float64]
    alignment: NDArray[np.float64]
    extent: NDArray[np.float64]
    offset: NDArray[np.float64]
    bulge: NDArray[np.float64]
    seen: NDArray[np.float64]


def close_pads(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    hands: HandPoses,
    openings: NDArray[np.float64],
    pad_size: tuple[float, float],
    finger_depth: float,
    patch_depth: float,
    seen: NDArray[np.float64] | None = None,
) -> PadContacts:
    """Close flat pads on the surface samples ``points``, ``normals`` (N, 3).

    ``patch_depth``: metres behind the first point of contact within which a sample still counts as touching:
    what the pad gives way, and the noise of the samples. ``seen``: (N,) 1 for measured samples, 0 for assumed ones;
    None: all were measured.
    """
    count = len(hands)
    result = PadContacts(
        width=np.zeros(count),
        centre=np.zeros((count, 3)),
        alignment=np.zeros(count),
        extent=np.zeros((count, 2)),
        offset=np.zeros(count),
        bulge=np.zeros(count),
        seen=np.ones(count),
    )
    for part in hands.passes(2 * len(points)):
        chunk = hands.selected(part)
        x, y, z = chunk.local(points)
        facing = [chunk.rotations[:, :, axis] @ normals.T for axis in range(3)]
        inside = (np.abs(x) <= pad_size[0] / 2) & (np.abs(y) <= openings[part, None] / 2)
        at_pads = inside & (np.abs(z) <= pad_size[1] / 2)
        above = inside & (z < -pad_size[1] / 2) & (z > -finger_depth)
        ends, middles, spreads, cosines, bulges, shares = [], [], [], [], [], []
        for sign in (1.0, -1.0):
            reach = np.where(at_pads, sign * y, -np.inf).max(axis=1)
            patch = at_pads & (sign * y >= reach[:, None] - patch_depth)
            weight = patch / np.maximum(patch.sum(axis=1), 1)[:, None]
            middle = np.stack([(weight * x).sum(axis=1), (weight * z).sum(axis=1)], axis=1)
            square = np.stack([(weight * x * x).sum(axis=1), (weight * z * z).sum(axis=1)], axis=1)
            ends.append(reach)
            middles.append(middle)
            spreads.append(np.sqrt(np.maximum(square - middle**2, 0.0)))
            mean = np.stack([(weight * component).sum(axis=1) for component in facing], axis=1)
            cosines.append(sign * mean[:, 1] / np.maximum(np.linalg.norm(mean, axis=1), 1e-9))
            shares.append(np.ones(len(chunk)) if seen is None else weight @ seen)
            bulges.append(np.where(above, sign * y, -np.inf).max(axis=1) - reach)
        met = np.isfinite(ends[0]) & np.isfinite(ends[1])
        width = np.where(met, ends[0] + ends[1], 0.0)
        result.width[part] = width
        result.centre[part, 1] = np.where(met, (ends[0] - ends[1]) / 2, 0.0)
        result.centre[part][:, [0, 2]] = (middles[0] + middles[1]) / 2
        result.alignment[part] = np.where(met, np.minimum(*cosines), -1.0)
        result.extent[part] = np.minimum(*spreads)
        result.offset[part] = np.linalg.norm(middles[0] - middles[1], axis=1)
        result.bulge[part] = np.where(met, np.maximum(np.maximum(*bulges), 0.0), 0.0)
        result.seen[part] = np.minimum(*shares)
    return result
