"""What hardware parts share that come to rest in one way, whoever asks for it."""

from __future__ import annotations

from abc import abstractmethod

from hal.hardware.hardware_part import HardwarePart
from hal.hardware.part_line import PartLine
from hal.hardware.stop_latch import StopLatch


class MovingPart(HardwarePart):
    """A part with one motion at a time, which ``brake`` brings to rest."""

    def __init__(self, name: str, latch: StopLatch) -> None:
        super().__init__(name)
        self._line = PartLine(name, latch)

    @abstractmethod
    def brake(self) -> None:
        """Come to rest within half a second."""

    def stop(self) -> None:
        """Come to rest, ending the motion under way."""
        with self._line.lock:
            if self._line.connected:
                self.brake()
                self._line.stop_motion()

    def detach(self) -> None:
        """The controller disconnects: come to rest."""
        with self._line.lock:
            self.brake()
            self._line.close()
