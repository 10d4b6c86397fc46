"""What detectors load before they are asked."""

from __future__ import annotations


class Prepared:
    """Something that may have to load models or reach a server; most have nothing to."""

    def prepare(self) -> None:
        """Load what is needed, before anything moves; raises PerceptionError, in words, where that is not possible."""
