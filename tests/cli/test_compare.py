from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer
from tests.evaluation.evaluated import finished_evaluation

Command = Callable[..., Answer]
RRT, BIT = "algorithms.motion_planning.algorithm=rrt_connect", "algorithms.motion_planning.algorithm=bit_star"
SUITE = """
first_seed: 3
episodes: 2
tasks:
  nothing: {task: fetch_cup, settings: [tree=nothing.xml]}
  again: {task: fetch_cup, settings: [tree=nothing.xml, scene.finger_friction=0.5]}
"""
NOTHING = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysFailure/></BehaviorTree></root>'


def test_two_entries_of_an_evaluation_are_compared_seed_by_seed(bestman_bt: Command, folder: Path) -> None:
    finished_evaluation(folder / "mine", {"rrt": RRT, "bit": BIT})

    answer = bestman_bt("compare", "mine:rrt", "mine:bit", "-o", "pairs.png")

    assert answer.code == 0, answer.err
    assert "### bit against rrt" in answer.out
    assert f"- rrt: task fetch_cup, {RRT}" in answer.out
    assert "success: no difference shown: rrt 6 of 6, bit 6 of 6" in answer.out
    assert "place_error_mm: the same in each of the 6 pairs." in answer.out
    assert (folder / "pairs.png").read_bytes().startswith(b"\x89PNG")
    document = bestman_bt("compare", "mine:rrt", "mine:bit", "--json").document
    assert document["comparisons"][0]["success"]["both"] == 6


@pytest.fixture(scope="module")
def evaluations(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two evaluations, ``mine`` and ``later``, that share no seed."""
    folder = tmp_path_factory.mktemp("evaluations")
    finished_evaluation(folder / "mine", {"bit": BIT})
    finished_evaluation(folder / "later", {"bit": BIT}, first_seed=500)
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "mine"], "nowhere: is not the folder of an evaluation"),
        (["nowhere", "mine:bot"], "nowhere: is not the folder of an evaluation: it has no summary.json mine:bot: the"),
        (["mine:bot", "mine"], "no entry 'bot'; did you mean 'bit'?"),
        (["mine", "mine", "-o", "pairs.pdf"], "PNG or SVG"),
        (["mine:bit", "later:bit"], "no seed is in both"),
    ],
)
def test_what_cannot_be_compared_is_reported(
    bestman_bt: Command, evaluations: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(evaluations)

    answer = bestman_bt("compare", *arguments)

    assert answer.code == 2
    assert words in " ".join(answer.err.replace("│", " ").split())


@pytest.mark.slow
def test_a_suite_compares_its_entries_and_keeps_the_picture(bestman_bt: Command, folder: Path) -> None:
    (folder / "nothing.xml").write_text(NOTHING)
    (folder / "mine.yaml").write_text(SUITE)

    answer = bestman_bt("eval", "mine.yaml", "--compare")

    assert answer.code == 0, answer.err  # no successes are asked
    assert "mine: no targets; 4 episodes" in answer.out
    assert "met" not in answer.out
    assert "kept in runs/evaluations/mine" in answer.err
    assert "again: fetch_cup with tree=nothing.xml, scene.finger_friction=0.5" in answer.err
    assert "success: no difference shown: nothing 0 of 2, again 0 of 2" in answer.out
    kept = folder / "runs" / "evaluations" / "mine"
    assert "### again against nothing" in (kept / "summary.md").read_text()
    assert (kept / "again_against_nothing.svg").is_file()
    assert len(list((kept / "runs").iterdir())) == 4


def test_one_entry_cannot_be_compared_with_another(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt("eval", "fetch_cup", "--compare")
    assert (answer.code, list(folder.iterdir())) == (2, [])
    assert "--compare: needs two entries, fetch_cup has one" in answer.err
