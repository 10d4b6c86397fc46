from __future__ import annotations

from types import SimpleNamespace

import pytest

from bestman_bt.evaluation.predicates.standing import rest_faults
from bestman_bt.messages import Pose


@pytest.mark.parametrize(
    ("moved", "held", "on", "faults"),
    [
        (0.0, False, "table", []),
        (0.0, True, "table", ["not let go"]),
        (0.002, False, "table", ["still moving"]),
        (0.0, False, "chest", ["not standing on the table"]),
    ],
)
def test_an_object_rests_where_it_lies_still_on_the_furniture_and_no_hand_touches_it(moved, held, on, faults) -> None:
    truth = SimpleNamespace(
        object_pose=lambda name: Pose([moved, 0.0, 0.8]),
        touches_robot=lambda name: held,
        supports=lambda name: (on,),
    )
    evidence = SimpleNamespace(truth=truth, before={"cup": (0.0, 0.0, 0.8)})
    assert rest_faults(evidence, "cup", "table/top") == faults
