"""Reachability maps on disk, one file per arm: what the map depends on is in the file's name."""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.kinematics.reachability_map import (
    ReachabilityMap,
    ReachabilitySampling,
)

_VERSION = 1
_LOG = logging.getLogger(__name__)
_FIELDS = ("origin", "voxel", "directions", "counts", "manipulability", "plenty")


def reachability_map(
    kinematics: InverseKinematics,
    limits: JointLimits,
    sampling: ReachabilitySampling | None = None,
    folder: Path | None = None,
) -> ReachabilityMap:
    """The map of an arm from ``folder`` (default: the user's cache), else built and put there.

    ``kinematics``: one with a ``fingerprint``. A file that cannot be read is built anew; a folder that cannot be
    written only costs the next start its time.
    """
    sampling = sampling or ReachabilitySampling()
    file = (folder or cache_folder()) / f"reachability-{_key(kinematics, sampling)}.npz"
    stored = _read(file)
    if stored is not None:
        return stored
    built = sampling.build(kinematics, limits)
    _write(file, built)
    return built


def cache_folder() -> Path:
    """``$XDG_CACHE_HOME/bestman-bt``, or ``~/.cache/bestman-bt``."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "bestman-bt"


def _key(kinematics: InverseKinematics, sampling: ReachabilitySampling) -> str:
    content = (_VERSION, kinematics.fingerprint, sorted(asdict(sampling).items()))
    return hashlib.sha256(repr(content).encode()).hexdigest()[:24]


def _read(file: Path) -> ReachabilityMap | None:
    if not file.is_file():
        return None
    try:
        with np.load(file, allow_pickle=False) as stored:
            values = {name: stored[name] for name in _FIELDS}
        found = ReachabilityMap(
            values["origin"],
            float(values["voxel"]),
            values["directions"],
            values["counts"],
            values["manipulability"],
            int(values["plenty"]),
        )
        if found.counts.ndim != 4 or found.counts.shape != found.manipulability.shape:
            raise ValueError(f"its arrays have the shapes {found.counts.shape} and {found.manipulability.shape}")
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        _LOG.warning("the stored reachability map %s cannot be used and is built anew: %s", file, error)
        return None
    return found


def _write(file: Path, built: ReachabilityMap) -> None:
    """In one step, so that a second process never reads half a file."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".npz", delete=False) as part:
            np.savez_compressed(
                part,
                origin=built.origin,
                voxel=built.voxel,
                directions=built.directions,
                counts=built.counts,
                manipulability=built.manipulability,
                plenty=built.plenty,
            )
        Path(part.name).replace(file)
    except OSError as error:
        _LOG.warning("the reachability map cannot be stored as %s: %s", file, error)
