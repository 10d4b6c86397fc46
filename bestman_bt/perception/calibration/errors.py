"""What is wrong with calibration data."""

from __future__ import annotations

from bestman_bt.perception.errors import PerceptionError


class CalibrationError(PerceptionError):
    """Data that a calibration cannot be computed from; the message says what to record instead."""


class DegenerateMotionError(CalibrationError):
    """The recorded motions leave a part of the unknowns undetermined, however many views there are."""
