"""A recorded run of a tree runs again without a robot: ``run --record``, then ``run --driver replay``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine.logs.btlog import read_btlog

Answers = Callable[..., Any]
TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="LookAround">
    <Sequence>
      <LookAt surface="table/top"/>
      <DetectObject object="cup" surface="table/top"/>
      <MoveArm posture="home"/>
    </Sequence>
  </BehaviorTree>
</root>
"""


def transitions(runs: Path) -> list[tuple[int, int]]:
    (folder,) = runs.iterdir()
    return [(entry.uid, entry.status) for entry in read_btlog(folder / "transitions.btlog").transitions]


def test_a_tree_goes_the_same_way_over_its_recording(bestman_bt: Answers, folder: Path) -> None:
    tree = folder / "look_around.xml"
    tree.write_text(TREE)
    first, second = folder / "first", folder / "second"
    recorded = bestman_bt(
        "run", tree, "--scene", "pick_place_table", "--robot", "diff_panda", "--seed", 5, "--record", "--runs", first
    )
    replayed = bestman_bt("run", "--driver", "replay", "--recording", next(first.iterdir()), "--runs", second)
    assert replayed.code == recorded.code
    assert transitions(second) == transitions(first)
    assert len(transitions(first)) > 6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "pick_place_table", "--driver", "replay"], "replay needs a recording"),
        (["--driver", "replay", "--recording", "nowhere"], "nowhere"),
        (["--driver", "pybullet", "--recording", "nowhere"], "nowhere"),
    ],
)
def test_a_replay_without_a_recording_is_wrong_input(bestman_bt: Answers, arguments: list[str], words: str) -> None:
    answer = bestman_bt("run", *arguments)
    assert answer.code == 2
    assert words in answer.err
