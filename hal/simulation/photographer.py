"""Third-person pictures of a scene, for people."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.simulation.bodies import Viewpoint, among
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot


class ScenePhotographer:
    """Takes pictures with shadows. As GroundTruth, it has to be made before time runs to be trusted."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._reader = robot.simulation.reader(ReadPurpose.RECORDING)
        self._built = robot.simulation.built

    def visible(self, viewpoint: Viewpoint, name: str, width: int = 160, height: int = 120) -> tuple[float, float]:
        """Shares of a small picture that show an object and the robot."""
        bodies, _ = self._reader.segments(viewpoint, width, height)
        thing = among(self._built.objects, name, "object")
        return float(np.mean(bodies == thing)), float(np.mean(bodies == self._built.robot))

    def picture(
        self, viewpoint: Viewpoint, width: int = 960, height: int = 720, oversampling: int = 2
    ) -> NDArray[np.uint8]:
        """(height, width, 3) uint8, smoothed by rendering ``oversampling`` times larger."""
        return smooth(self._reader.photo(viewpoint, width * oversampling, height * oversampling), oversampling)


def smooth(rgb: NDArray[np.uint8], oversampling: int) -> NDArray[np.uint8]:
    """A picture (H, W, 3) from one that is ``oversampling`` times larger: means of its pixels."""
    height, width = rgb.shape[0] // oversampling, rgb.shape[1] // oversampling
    blocks = rgb.astype(np.float64).reshape(height, oversampling, width, oversampling, 3).mean(axis=(1, 3))
    picture: NDArray[np.uint8] = np.round(blocks).astype(np.uint8)
    return picture
