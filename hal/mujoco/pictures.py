"""Pictures of shapes for people, by MuJoCo's renderer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PlacedShape, Pose
from hal.mujoco.package import mujoco
from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.renderer import Renderer
from hal.mujoco.world_builder import Shapes
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import smooth


def render_object(
    parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]],
    viewpoint: Viewpoint,
    width: int = 480,
    height: int = 480,
) -> NDArray[np.uint8]:
    """Render shapes with their colours on white: (height, width, 3) uint8."""
    shapes = Shapes(MujocoParameters())
    shapes.light()
    body = shapes.body(shapes.spec.worldbody, "object", Pose())
    shapes.geoms(body, [part for part, _ in parts], [(*color, 1.0) for _, color in parts], None)
    model = shapes.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = Renderer(model, data)
    try:
        return smooth(renderer.view(viewpoint, 2 * width, 2 * height), 2)
    finally:
        renderer.close()
