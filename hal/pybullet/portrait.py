"""Pictures of single things, without a world around them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PlacedShape
from hal.pybullet.body_urdf import body_urdf
from hal.pybullet.client import PhysicsClient, ReadPurpose
from hal.pybullet.render import Viewpoint, smooth_picture


def portrait(
    parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]],
    viewpoint: Viewpoint,
    width: int = 480,
    height: int = 480,
) -> NDArray[np.uint8]:
    """Shapes and their colours before white: (height, width, 3) uint8."""
    client = PhysicsClient()
    client.connect()
    try:
        with TemporaryDirectory() as folder:
            urdf = body_urdf("portrait", 0.0, (), [(part, (*color, 1.0)) for part, color in parts], Path(folder))
            file = Path(folder) / "portrait.urdf"
            file.write_text(urdf, encoding="utf-8")
            client.loadURDF(str(file), useFixedBase=True)
        return smooth_picture(client.reader(ReadPurpose.RECORDING), viewpoint, width, height)
    finally:
        client.disconnect()
