"""Numbers over time: all curves of a plot on one entity, one call per sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rerun as rr

CURVE_COLORS = (
    (78, 161, 255),
    (255, 160, 60),
    (90, 200, 110),
    (240, 90, 90),
    (175, 130, 255),
    (230, 205, 70),
    (80, 205, 200),
    (245, 135, 195),
)


class TimeSeries:
    """The curves ``names`` of the plot ``entity``."""

    def __init__(self, recording: rr.RecordingStream, entity: str, names: Sequence[str]) -> None:
        self._recording = recording
        self._entity = entity
        self._names = tuple(names)

    def write_styles(self) -> None:
        """Write names and colours of the curves."""
        import rerun as rr

        if self._names:
            colors = [CURVE_COLORS[i % len(CURVE_COLORS)] for i in range(len(self._names))]
            self._recording.log(
                self._entity, rr.SeriesLines(names=short_names(self._names), colors=colors, widths=1.5), static=True
            )

    def write(self, values: Sequence[float]) -> None:
        """Write one value per curve, at the time that is set on the recording."""
        import rerun as rr

        if self._names:
            self._recording.log(self._entity, rr.Scalars(values))


def short_names(names: Sequence[str]) -> list[str]:
    """The names without what they all begin with, up to an underscore: ``panda_joint1`` is ``joint1``."""
    shared = 0
    if len(names) > 1:
        first, last = min(names), max(names)
        while shared < len(first) and first[shared] == last[shared]:
            shared += 1
    start = names[0][:shared].rfind("_") + 1 if names else 0
    return [name[start:] for name in names]
