"""Trees that are simulated: what leaves do, what is told of a run, what runs have tried."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import FAILURE, SUCCESS, StatefulAction, SubstitutionRules, TestNodeConfig
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.coverage import Coverage
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.scenario import Scenario, ScenarioError
from bestman_bt.engine.simulation import SimulatedRun, simulate


def tree(body: str, tree_id: str = "Main") -> str:
    return f'<root BTCPP_format="4"><BehaviorTree ID="{tree_id}">{body}</BehaviorTree></root>'


def played(body: str, **scenario: Any) -> SimulatedRun:
    return simulate(tree(body), scenario=Scenario.from_mapping(scenario))


def test_leaves_do_what_the_first_rule_that_fits_says() -> None:
    run = played(
        '<Sequence><Move name="a"/><Move name="b"/><Look/></Sequence>',
        nodes={"b": {"result": "SUCCESS", "duration": 3}, "Move": {"duration": 1, "result": "SUCCESS"}},
        default="SUCCESS",
    )
    assert run.outcome == "success"
    assert run.seconds == pytest.approx(4.0)
    assert run.order == ["Sequence::1", "a", "b", "Look::4"]
    assert run.simulated == {"Move": "a guess from its use", "Look": "a guess from its use"}


def test_results_come_in_turn_and_the_last_one_stays() -> None:
    body = '<RetryUntilSuccessful num_attempts="9"><Grasp/></RetryUntilSuccessful>'
    run = played(body, nodes={"Grasp": {"results": ["FAILURE", "FAILURE", "SUCCESS"]}})
    assert run.outcome == "success"
    assert run.order.count("Grasp::2") == 3


def test_a_timeout_halts_a_simulated_leaf_in_simulated_time() -> None:
    run = played('<Timeout msec="2000"><Move name="far"/></Timeout>', nodes={"far": {"duration": 60}})
    assert (run.outcome, run.halted) == ("failure", ["far"])
    assert run.seconds == pytest.approx(2.0, abs=0.051)


def test_scripts_conditions_and_subtrees_run_for_real_with_the_outputs_that_are_given() -> None:
    body = (
        '<Sequence><Count n="{n}"/><Script code="n += 1"/><ScriptCondition code="n == 4"/>'
        '<AlwaysFailure _skipIf="n == COUNTED"/></Sequence>'
    )
    run = played(body, nodes={"Count": {"result": "SUCCESS", "outputs": {"n": 3}}}, enums={"COUNTED": 4})
    assert (run.outcome, run.tree.blackboard.get("n")) == ("success", 4)


def test_a_wrong_script_ends_the_run_with_what_is_wrong() -> None:
    run = played('<Sequence><Script code="a := 1"/><Script code="a = \'x\'"/></Sequence>')
    assert run.outcome == "error"
    assert "Script" in run.error


def test_entries_that_nobody_writes_get_a_value_and_are_reported() -> None:
    run = played('<Sequence><ScriptCondition code="ready == 0"/><Sleep msec="{wait}"/></Sequence>')
    assert (run.outcome, sorted(run.invented)) == ("success", ["ready", "wait"])
    given = played('<ScriptCondition code="ready == 1"/>', entries={"ready": 1})
    assert (given.outcome, given.invented) == ("success", [])
    assigned = played('<Sequence><Script code="mode = 3"/><ScriptCondition code="mode == 3"/></Sequence>')
    assert (assigned.outcome, assigned.invented) == ("success", ["mode"]), "'=' does not create an entry"
    text = played("<Sequence><AlwaysSuccess _skipIf=\"phase == 'TIMEOUT'\"/><AlwaysSuccess/></Sequence>")
    assert (text.outcome, text.invented) == ("success", ["phase"])
    decorated = played('<Sequence><Look found="{mug}"><Move/></Look><ScriptCondition code="mug == 0"/></Sequence>')
    assert (decorated.outcome, decorated.invented) == ("success", ["mug"]), "simulated decorators write nothing"
    guessed = played('<Repeat num_cycles="{times}"><Average samples="{times}"/></Repeat>')
    assert (guessed.outcome, guessed.invented) == ("success", ["times"])
    posted = played('<Sequence><Look _onSuccess="seen := 1"/><ScriptCondition code="seen == 1"/></Sequence>')
    assert (posted.outcome, posted.invented) == ("success", [])
    created = played('<Sequence><Script code="mode := 1; mode = 3"/><ScriptCondition code="mode == 3"/></Sequence>')
    assert (created.outcome, created.invented) == ("success", [])


@pytest.mark.parametrize(
    "code",
    [
        "a == b; b == 'x'",
        "b == 'x'; a == b; c == a",
        "a = b; b == 'x'",
        "a = (b = c); b == 'x'",
        "a = f ? 'a' : 'b'",
        "a = f ? b : c; c == 'x'",
        "(f ? a : b) == 'x'; a == b",
        "a = b + 'x'; b == c",
        "a = f .. 'x'; a == b",
        "a += b; b == 'x'",
        "a = 1; b == 'x'; b != c",
        "a = (b == 'x'); a == ON",
        "a = b == 'x' ? c : ON; c == ON",
        "f == ON ? a == 'x' : b == ON",
    ],
)
def test_an_entry_that_is_used_as_a_text_by_way_of_another_gets_a_text(code: str) -> None:
    run = played(f'<Sequence><Script code="{code}"/></Sequence>', enums={"ON": 1})
    assert (run.outcome, run.error) == ("success", "")
    assert set(run.invented) <= {"a", "b", "c", "f"}


def test_an_entry_is_a_text_if_it_is_used_as_one_through_the_port_of_a_subtree() -> None:
    xml = """<root BTCPP_format="4" main_tree_to_execute="Main">
      <BehaviorTree ID="Main"><Sequence><SubTree ID="Inner" inner="{outer}"/>
        <AlwaysSuccess _skipIf="outer == other"/><ScriptCondition code="other != 'x'"/></Sequence></BehaviorTree>
      <BehaviorTree ID="Inner"><ScriptCondition code="inner != 'y'"/></BehaviorTree></root>"""
    run = simulate(xml, scenario=Scenario())
    assert (run.outcome, sorted(run.invented)) == ("success", ["other", "outer"])


@pytest.mark.slow
def test_a_tree_that_never_ends_reaches_the_time_limit() -> None:
    run = played("<KeepRunningUntilFailure><Move/></KeepRunningUntilFailure>", default="SUCCESS")
    assert run.outcome == "time limit"
    awake = played('<Repeat num_cycles="-1"><AlwaysSuccess/></Repeat>')
    assert awake.outcome == "time limit"


def test_one_seed_gives_one_run_and_others_differ() -> None:
    body = "<Fallback><Sequence><A/><B/></Sequence><C/></Fallback>"
    runs = [simulate(tree(body), scenario=Scenario(), seed=seed).transitions for seed in (1, 1, 2, 3, 4, 5)]
    assert runs[0] == runs[1]
    assert len({tuple(run) for run in runs}) > 2


class Turn(StatefulAction):
    """Would move something."""

    def on_start(self) -> int:
        """Fail the test."""
        raise AssertionError


def test_leaves_with_code_are_simulated_too_and_trees_of_a_package_are_found(tmp_path: Path) -> None:
    registry = NodeRegistry()
    registry.register(Turn)
    (tmp_path / "inner.xml").write_text(tree("<Turn/>", "Inner"))
    scenario = Scenario.from_mapping({"default": "SUCCESS"})
    run = simulate(tree('<SubTree ID="Inner"/>'), registry, scenario=scenario, package=Package.open([tmp_path]))
    assert (run.outcome, run.simulated) == ("success", {"Turn": "the registry"})


def test_decorators_without_code_give_back_the_result_and_controls_go_through_their_children() -> None:
    run = played("<Each><All><A/><B/></All></Each>", nodes={"A": "SUCCESS", "B": "FAILURE"})
    assert (run.outcome, run.order[-1]) == ("failure", "B::4")


def test_substitution_rules_of_behaviortree_cpp_are_read(tmp_path: Path) -> None:
    path = tmp_path / "rules.json"
    path.write_text(
        '{"TestNodeConfigs": {"late": {"return_status": "FAILURE", "async_delay": 2000}}, '
        '"SubstitutionRules": {"A": "late"}}'
    )
    run = simulate(tree("<A/>"), scenario=Scenario.load(path))
    assert (run.outcome, run.seconds) == ("failure", pytest.approx(2.0))
    rules = SubstitutionRules({"A": TestNodeConfig(SUCCESS)})
    assert simulate(tree("<A/>"), scenario=Scenario(), substitutions=rules).status == SUCCESS


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("nodes: {A: {result: YES}}", "nodes.A: a result should be RUNNING, SUCCESS, FAILURE, SKIPPED, got True"),
        ("nodes: {A: {duration: [2, 1]}}", "nodes.A.duration: should be seconds, or [least, most], got [2, 1]"),
        ("nodes: {A: {success: 2}}", "nodes.A.success: should be a chance from 0 to 1, got 2"),
        ("nodes: {A: {sucess: 1}}", "nodes.A.sucess: unknown; known are result, results"),
        ("node: {}", "node: unknown; known are nodes, default, entries, enums"),
        ("enums: {A: one}", "enums.A: should be a whole number, got 'one'"),
        ("- a", "it should be a mapping"),
        ("a: [", "s.yaml:1: it is not YAML"),
        ("a: &x [1]\nb: *x", "anchors and aliases are not read"),
    ],
)
def test_a_scenario_with_a_fault_is_refused(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(ScenarioError) as error:
        Scenario.load(tmp_path / "s.yaml")
    assert told in str(error.value)


def test_coverage_reports_what_runs_have_not_tried() -> None:
    body = '<Sequence><Fallback name="or"><A/><Sequence name="way out"><B/><C/></Sequence></Fallback><D/></Sequence>'
    run = played(body, default="SUCCESS")
    coverage = Coverage(run.tree)
    coverage.add(run.transitions)
    assert [node.name for node in coverage.never_ticked] == ["way out"]
    assert [node.name for node in coverage.unused_recoveries] == ["or"]
    assert [node.name for node in coverage.never_failed] == ["A", "D"]
    assert coverage.share == pytest.approx(4 / 7)
    coverage.add(played(body, nodes={"A": "FAILURE", "D": {"duration": 9999}}, default="SUCCESS").transitions)
    assert (coverage.never_ticked, coverage.unused_recoveries) == ([], [])
    use = coverage.of(run.tree.node("D::7"))
    assert (use.began, use.succeeded, use.halted) == (2, 1, 1)
    assert [node.name for node in coverage.never_left] == []
    assert FAILURE not in {state for _, state in run.transitions}


def test_a_node_that_was_skipped_has_finished() -> None:
    run = played('<Sequence><Sequence name="none"><A _skipIf="true"/></Sequence><B/></Sequence>', default="SUCCESS")
    coverage = Coverage(run.tree)
    coverage.add(run.transitions)
    assert coverage.never_left == []
    assert [node.name for node in coverage.never_ticked] == ["A"]
