"""Labels stand beside what they name; they cover neither each other nor what should stay in sight."""

from __future__ import annotations

from itertools import combinations

import pytest

from bestman_bt.visualization.annotated_image import GAP, Label, overlap, place_labels

PICTURE = (640.0, 480.0)


def test_a_lone_label_stands_right_beside_its_anchor() -> None:
    ((left, top, right, bottom),) = place_labels([Label((300.0, 200.0), (100.0, 20.0))], [], PICTURE)
    assert (right - left, bottom - top) == (100.0, 20.0)
    nearest = min(max(300.0, left), right), min(max(200.0, top), bottom)
    assert max(abs(nearest[0] - 300.0), abs(nearest[1] - 200.0)) == pytest.approx(GAP)


def test_labels_of_a_crowd_do_not_cover_each_other() -> None:
    crowd = [Label((300.0 + 15 * (i % 3), 200.0 + 12 * (i // 3)), (160.0, 20.0)) for i in range(9)]
    places = place_labels(crowd, [], PICTURE)
    assert all(overlap(one, other) == 0.0 for one, other in combinations(places, 2))


def test_a_label_leaves_free_what_should_stay_in_sight() -> None:
    thing = (280.0, 180.0, 420.0, 240.0)
    (place,) = place_labels([Label((300.0, 200.0), (100.0, 20.0))], [thing], PICTURE)
    assert overlap(place, thing) == 0.0


@pytest.mark.parametrize("anchor", [(1.0, 1.0), (639.0, 479.0), (1.0, 479.0), (320.0, 0.0)])
def test_labels_stay_in_the_picture(anchor) -> None:
    ((left, top, right, bottom),) = place_labels([Label(anchor, (100.0, 20.0))], [], PICTURE)
    assert min(left, top) >= 0.0
    assert right <= 640.0
    assert bottom <= 480.0


def test_a_label_wider_than_the_picture_begins_at_its_left_border() -> None:
    ((left, _, right, _),) = place_labels([Label((320.0, 240.0), (900.0, 20.0))], [], PICTURE)
    assert (left, right) == (0.0, 900.0)
