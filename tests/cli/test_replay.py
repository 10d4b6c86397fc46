"""A recorded run of a tree runs again without a robot: ``run --record``, then ``run --driver replay``."""

from __future__ import annotations

import itertools
import os
import re
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine.logs.btlog import read_btlog
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.run_folder import make_run_folder

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


@pytest.mark.slow
def test_a_goal_is_not_judged_where_the_recording_is_over(bestman_bt: Answers, folder: Path) -> None:
    tree = folder / "posture.xml"
    text = TREE.replace('<DetectObject object="cup" surface="table/top"/>', "")
    tree.write_text(text)
    bestman_bt("run", tree, "--task", "pick_place_table", "--record", "--runs", folder / "runs")
    tree.write_text(text.replace("</Sequence>", '<Sleep msec="600000"/></Sequence>'))
    over = bestman_bt("run", tree, "--driver", "replay", "--recording", next((folder / "runs").iterdir()), "--json")
    assert over.document["failure"]["error_code"] == "recording_over"
    assert over.document["not_judged"] == "not judged: the recording ended before its tree"


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

    tree.write_text(TREE.replace("</Sequence>", '<Sleep name="on" msec="600000"/></Sequence>'))
    longer = bestman_bt("run", tree, "--driver", "replay", "--recording", next(first.iterdir()), "--json")
    assert (longer.code, longer.document["outcome"]) == (3, "error")
    failure, end = longer.document["failure"], longer.document["sim_time_s"]
    assert failure["error_code"] == "recording_over"
    told = re.fullmatch(r"the recording is over at (\S+) s, and on \(look_around.xml:8\) still ran", failure["why"])
    assert told is not None
    assert float(told[1]) + 0.9 < end < float(told[1]) + 1.1


@pytest.mark.slow
def test_the_replay_of_a_run_that_was_cancelled_ends_where_that_did(bestman_bt: Answers, folder: Path) -> None:
    tree = folder / "look_around.xml"
    tree.write_text(TREE)
    config = load_run(tree=tree, scene="pick_place_table", robot="diff_panda", seed=5)
    first = make_run_folder(replace(config, record=True), folder / "first")

    def stop_after_ten_ticks(*_: Any) -> Callable[[], None]:
        ticks = itertools.count(1)
        return lambda: os.kill(os.getpid(), signal.SIGINT) if next(ticks) == 10 else None

    recorded = run_episode(replace(config, record=True), first, watch=stop_after_ten_ticks)
    replayed = bestman_bt("run", "--driver", "replay", "--recording", first, "--runs", folder / "second", "--json")
    assert (recorded.outcome, replayed.code) == ("cancelled", 130)
    assert replayed.document["failure"]["why"] == "the run that is replayed was cancelled here"
    assert recorded.sim_time_s - 0.051 < replayed.document["sim_time_s"] <= recorded.sim_time_s  # a tick of 20 Hz
    assert transitions(folder / "second") == transitions(folder / "first")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "pick_place_table", "--driver", "replay"], "replay needs a recording"),
        (["--driver", "replay", "--recording", "nowhere"], "--recording: nowhere is not a run folder"),
        (["--driver", "pybullet", "--recording", "nowhere"], "nowhere"),
    ],
)
def test_a_replay_without_a_recording_is_wrong_input(bestman_bt: Answers, arguments: list[str], words: str) -> None:
    answer = bestman_bt("run", *arguments)
    assert answer.code == 2
    assert words in answer.err
