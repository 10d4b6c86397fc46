"""Generation of furniture by kind, from options and a random generator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from bestman_bt.registry import suggestion
from bestman_bt.scene.furniture_generator.appliances import (
    DishwasherOptions,
    FridgeOptions,
    MicrowaveOptions,
    dishwasher,
    fridge,
    microwave,
)
from bestman_bt.scene.furniture_generator.cabinets import (
    CupboardOptions,
    DrawerChestOptions,
    ShelfOptions,
    cupboard,
    drawer_chest,
    shelf,
)
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.room_door import RoomDoorOptions, room_door
from bestman_bt.scene.scene import FurnitureModel

_KINDS: Mapping[str, tuple[type, Callable[..., FurnitureModel]]] = {
    "shelf": (ShelfOptions, shelf),
    "drawer_chest": (DrawerChestOptions, drawer_chest),
    "fridge": (FridgeOptions, fridge),
    "cupboard": (CupboardOptions, cupboard),
    "microwave": (MicrowaveOptions, microwave),
    "dishwasher": (DishwasherOptions, dishwasher),
    "room_door": (RoomDoorOptions, room_door),
}
FURNITURE_KINDS = tuple(_KINDS)


def generate_furniture(kind: str, rng: np.random.Generator, name: str | None = None, **options: Any) -> FurnitureModel:
    """Return a piece of furniture of a kind of FURNITURE_KINDS, deterministically.

    ``options``: fields of the kind's options, for example ``drawers=3, handle=HandleOptions(kind="bar")``; missing ones
    are drawn. Raises FurnitureOptionError.
    """
    chosen = options_of(kind)
    known = [field.name for field in fields(chosen)]
    for key in options:
        if key not in known:
            raise FurnitureOptionError((key,), f"unknown option of a {kind}; {suggestion(key, known)}")
    _, build = _KINDS[kind]
    return build(name or kind, chosen(**options), rng)


def options_of(kind: str) -> type:
    """Return the options' dataclass of a kind. Raises FurnitureOptionError naming the kinds."""
    if kind not in _KINDS:
        message = f"unknown kind of furniture {kind!r}; {suggestion(kind, list(FURNITURE_KINDS))}"
        raise FurnitureOptionError(("kind",), message)
    return _KINDS[kind][0]
