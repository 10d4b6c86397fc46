"""An open shelf: boards between two sides."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bestman_bt.configuration.quantity import PositiveLength, WholeNumber
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions, draw_finish, model, surface
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel


@dataclass(frozen=True)
class ShelfOptions:
    """Options; missing ones are drawn. ``boards``: 2 to 8, the lowest and the top one included; ``back``: a back wall.

    Surfaces: ``board_1`` (lowest) to ``top``.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    boards: WholeNumber | None = None
    back: bool | None = None
    finish: FinishOptions = field(default_factory=FinishOptions)


def shelf(name: str, options: ShelfOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a shelf; raises FurnitureOptionError."""
    drawn = rng.uniform((0.60, 0.28, 0.80), (1.10, 0.40, 1.60))
    count, has_back = int(rng.integers(3, 6)), bool(rng.random() < 0.5)
    width, depth, height = (
        float(given or value)
        for given, value in zip((options.width, options.depth, options.height), drawn, strict=True)
    )
    count = count if options.boards is None else options.boards
    if not 2 <= count <= 8:
        raise FurnitureOptionError(("boards",), f"should be from 2 to 8, got {count}")
    thickness, lowest = 0.020, 0.08
    pitch = (height - lowest) / (count - 1)
    if pitch < 0.12:
        message = f"{count} boards in {height:g} m leave {pitch - thickness:.3f} m between them; 0.10 m is the least"
        raise FurnitureOptionError(("boards",), message)
    finish = draw_finish(options.finish, rng, ("white", "wood", "dark"))
    half, front, rear = width / 2, -depth / 2, depth / 2
    has_back = has_back if options.back is None else options.back
    solids = [
        block((front, -half, 0.0), (rear, -half + thickness, height), finish.body),
        block((front, half - thickness, 0.0), (rear, half, height), finish.body),
    ]
    inner_back = rear - 0.006 if has_back else rear
    if has_back:
        solids.append(block((inner_back, -half + thickness, lowest), (rear, half - thickness, height), finish.body))
    surfaces = []
    for index in range(count):
        top = lowest + index * pitch
        solids.append(
            block((front, -half + thickness, top - thickness), (inner_back, half - thickness, top), finish.front)
        )
        board = "top" if index == count - 1 else f"board_{index + 1}"
        surfaces.append(surface(board, (front, inner_back), (-half + thickness, half - thickness), top))
    return model(name, (depth, width), solids, surfaces)
