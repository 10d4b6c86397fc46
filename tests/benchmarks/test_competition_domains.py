"""The benchmark on domains of the planning competitions: generated problems, plans, results that are counted."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.competition_domains import DOMAINS, GENERATORS, measured, table
from benchmarks.competition_domains import Stated as Problem
from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl


@pytest.fixture(params=GENERATORS)
def generated(request, tmp_path: Path) -> Problem:
    generate, sizes = GENERATORS[request.param]
    (tmp_path / "problem.pddl").write_text(generate(sizes[1], np.random.default_rng(3)))
    return Problem(request.param, DOMAINS / f"{request.param}.pddl", tmp_path / "problem.pddl")


@pytest.mark.slow
def test_a_generated_problem_is_planned_and_its_plan_accepted_by_unified_planning(generated: Problem) -> None:
    pytest.importorskip("unified_planning", reason="the extra planning is not installed")
    found = measured("symbolic", generated, limit=60)
    assert found["result"] == "solved"
    assert found["valid"] is True
    assert found["length"] > 4


def test_generated_problems_grow_with_their_size_and_differ_by_seed(tmp_path: Path) -> None:
    for name, (generate, sizes) in GENERATORS.items():
        goals = []
        for size in sizes:
            texts = [generate(size, np.random.default_rng(seed)) for seed in (1, 2)]
            assert (texts[0] != texts[1]) == (name != "gripper")
            file = tmp_path / f"{name}{size}.pddl"
            file.write_text(texts[0])
            problem = read_pddl(DOMAINS / f"{name}.pddl", file)
            assert problem.unmet_in(problem.state)
            goals.append(len(problem.goal))
        assert goals == sorted(set(goals))


def test_what_a_planner_cannot_read_is_counted_apart_from_what_it_does_not_solve(tmp_path: Path) -> None:
    domain = tmp_path / "domain.pddl"
    domain.write_text(
        "(define (domain lamp) (:predicates (on) (cold)) (:action turn :parameters () "
        ":precondition (preference soon (cold)) :effect (on)))"
    )
    problem = tmp_path / "problem.pddl"
    problem.write_text("(define (problem p) (:domain lamp) (:init (cold)) (:goal (and (on))))")
    found = measured("symbolic", Problem("lamp", domain, problem), limit=60)
    assert found["result"] == "not read"
    assert "preference is not supported" in found["why"]
    row = {"group": "lamp", "problem": "p", "symbolic": found}
    assert table([row], ["symbolic"])[0]["symbolic"]["results"] == {"not read": 1}


def test_a_plan_that_takes_too_long_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endless = tmp_path / "endless.py"
    endless.write_text("while True: pass")
    monkeypatch.setattr("benchmarks.competition_domains.__file__", str(endless))
    assert measured("symbolic", Problem("", endless, endless), limit=1)["result"] == "limit"
