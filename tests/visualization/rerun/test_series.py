from __future__ import annotations

import pytest

from bestman_bt.visualization.rerun.open_recording import short_names


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["panda_joint1", "panda_joint2"], ["joint1", "joint2"]),
        (["left_arm_elbow", "left_arm_wrist"], ["elbow", "wrist"]),
        (["elbow", "wrist"], ["elbow", "wrist"]),
        (["panda_joint1"], ["panda_joint1"]),
        ([], []),
    ],
)
def test_curves_are_named_by_what_tells_them_apart(names, short):
    assert short_names(names) == short
