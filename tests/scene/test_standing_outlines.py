"""What a start, a goal or a pedestrian keeps away from."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bestman_bt.messages import Box
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.placing import articulation_outlines
from bestman_bt.scene.scene import PlacedFurniture


@pytest.fixture(scope="module")
def chest() -> PlacedFurniture:
    """Closed, and not where the map has it."""
    return next(p for p in draw_world(load_scene("chest_room"), 0).furniture if p.model.articulations)


def test_doors_stand_in_the_way_where_they_are_open_and_those_between_rooms_also_while_closed(
    chest: PlacedFurniture,
) -> None:
    drawer = chest.model.articulations[0]
    boards = [part for part in drawer.parts if isinstance(part.shape, Box)]
    assert list(articulation_outlines(chest)) == []
    passage = replace(chest, model=replace(chest.model, is_passage=True, articulations=(drawer,)))
    closed, opened = (
        list(articulation_outlines(replace(passage, open={drawer.name: at}))) for at in (0.0, drawer.upper)
    )
    assert len(closed) == len(opened) == len(boards)
    assert len(list(articulation_outlines(replace(chest, open={drawer.name: drawer.upper})))) == len(boards)
    way = drawer.upper * (chest.pose.rotation @ drawer.axis)[:2]
    for one, other in zip(closed, opened, strict=True):
        assert (other - one).mean(axis=0) == pytest.approx(way, abs=1e-9)
