"""What `validate` finds beyond the load errors, the substitution rules, the views of a tree, and simulated runs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    NodeError,
    NodeRegistry,
    PortInformation,
    Sleep,
    StatefulAction,
    SubstitutionError,
    SubstitutionRules,
    TestNodeConfig,
    TreeLoadError,
    TreeProblem,
    build_tree,
    current_states,
    load_tree,
    render_dot,
    render_ports,
    render_svg,
    render_text,
    simulate,
    validate_file,
)
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.models.scenario import Scenario


class Grasp(StatefulAction):
    INPUT_PORTS = {"target": PortInformation(str)}
    OUTPUT_PORTS = {"width": PortInformation(float, False)}

    def on_start(self) -> int:
        raise AssertionError("there is no robot in a test")


@pytest.fixture
def registry() -> NodeRegistry:
    registry = NodeRegistry()
    registry.register(Grasp)
    return registry


def file(tmp_path: Path, main: str, more: str = "") -> Path:
    path = tmp_path / "tree.xml"
    path.write_text(
        f'<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n{main}\n</BehaviorTree>\n'
        f"{more}</root>"
    )
    return path


def found(path: Path, registry: NodeRegistry, **options: object) -> list[str]:
    return [str(problem).replace(str(path), "tree.xml") for problem in validate_file(path, registry, **options)]


def test_a_tree_without_fault_has_no_problems(tmp_path: Path, registry: NodeRegistry) -> None:
    body = '<Sequence><Script code="cup := \'mug\'"/><Grasp target="{cup}" width="{w}"/></Sequence>'
    assert found(file(tmp_path, body), registry) == []


def test_errors_are_listed_without_raising(tmp_path: Path, registry: NodeRegistry) -> None:
    assert found(file(tmp_path, "<Grap/>"), registry) == [
        "tree.xml:3: <Grap>: unknown node 'Grap' (did you mean 'Grasp'?)"
    ]


def test_an_entry_that_is_read_and_never_written_is_a_warning(tmp_path: Path, registry: NodeRegistry) -> None:
    path = file(tmp_path, '<Sequence><Grasp target="{cup}"/><ScriptCondition code="ready == 1"/></Sequence>')
    assert found(path, registry) == [
        "tree.xml:3: warning: <Grasp> port 'target': reads '{cup}', which nothing in the tree writes",
        "tree.xml:3: warning: <ScriptCondition> port 'code': reads '{ready}', which nothing in the tree writes",
    ]
    assert found(path, registry, given=["cup", "ready"]) == []


def test_a_port_that_was_not_mapped_into_a_subtree_is_suggested(tmp_path: Path, registry: NodeRegistry) -> None:
    path = file(
        tmp_path,
        '<Sequence><Script code="cup := \'mug\'"/><SubTree ID="Pick"/></Sequence>',
        '<BehaviorTree ID="Pick"><Grasp target="{cup}"/></BehaviorTree>',
    )
    (warning,) = found(path, registry)
    assert "the enclosing tree has 'cup'; map it with cup=\"{cup}\"" in warning


def test_children_that_can_never_be_ticked_are_a_warning(tmp_path: Path, registry: NodeRegistry) -> None:
    body = (
        "<Sequence>\n<Fallback>\n<ForceSuccess><Grasp target='a'/></ForceSuccess>\n<AlwaysSuccess name='late'/>\n"
        "</Fallback>\n<AlwaysFailure name='stop'/>\n<Grasp target='b'/>\n<AlwaysSuccess _skipIf='1 == 1'/></Sequence>"
    )
    messages = found(file(tmp_path, body), registry)
    assert [m.split(" warning: ")[0] for m in messages] == ["tree.xml:6:", "tree.xml:9:", "tree.xml:10:"]
    assert "it can never be ticked: the earlier child 'stop' always ends or blocks the parent" in messages[1]


def test_unused_trees_shadowing_literals_and_misspelt_scripts_are_warnings(
    tmp_path: Path, registry: NodeRegistry
) -> None:
    path = file(
        tmp_path,
        '<Sequence><Script code="speed := 1" _skipif="1"/><SubTree ID="A" _autoremap="true" speed="2"/></Sequence>',
        '<BehaviorTree ID="A"><Script code="speed += 1"/></BehaviorTree>\n'
        '<BehaviorTree ID="B"><AlwaysSuccess/></BehaviorTree>',
    )
    messages = found(path, registry)
    assert len(messages) == 3
    assert any("port 'speed': the literal shadows the outer entry of this name" in m for m in messages)
    assert any(
        "'_skipif': it is not a script attribute and has no effect (did you mean '_skipIf'?)" in m for m in messages
    )
    assert any("tree 'B' is never used" in m for m in messages)


TREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence name="fetch"><Script name="init" code="cup := 'mug'"/>
<SubTree ID="Pick" name="pick" target="{cup}" width="{opening}"/><ScriptCondition code="opening &gt; 0"/></Sequence>
</BehaviorTree>
<BehaviorTree ID="Pick"><Fallback><Grasp name="first" target="{target}" width="{width}"/>
<Grasp name="second" target="{target}" width="{width}"/></Fallback></BehaviorTree></root>"""


def rules() -> SubstitutionRules:
    return (
        SubstitutionRules()
        .add("first", TestNodeConfig(return_status=FAILURE, async_delay=1.0))
        .add("pick/sec*", TestNodeConfig(success_script="width := 0.04", async_delay=0.5))
    )


def test_a_tree_runs_without_its_robot_in_simulated_time(registry: NodeRegistry) -> None:
    run = simulate(TREE, registry, substitutions=rules(), period=0.25)
    assert run.succeeded
    assert run.seconds == pytest.approx(1.5)
    assert run.tree.blackboard["opening"] == 0.04
    assert run.visited("pick/second")
    assert [(t, p) for t, p, s in run.changes if s == FAILURE] == [(pytest.approx(1.0), "pick/first")]


def test_a_simulated_run_ends_at_its_limit(registry: NodeRegistry) -> None:
    endless = SubstitutionRules({"Grasp": TestNodeConfig(async_delay=1e9)})
    run = simulate(TREE, registry, substitutions=endless, limit=2.0)
    assert run.status == RUNNING
    assert run.seconds < 2.1
    assert all(node.state == 0 for node in run.tree.nodes)


def test_rules_are_read_from_behaviortree_cpps_json(registry: NodeRegistry) -> None:
    text = json.dumps(
        {
            "TestNodeConfigs": {"bad": {"return_status": "FAILURE", "async_delay": 500}},
            "SubstitutionRules": {"pick/first": "bad", "second": "AlwaysFailure"},
        }
    )
    run = simulate(TREE, registry, substitutions=SubstitutionRules.from_json(text), period=0.5)
    assert (run.status, run.seconds) == (FAILURE, pytest.approx(0.5))


def test_a_scripted_result_knows_the_statuses(registry: NodeRegistry) -> None:
    config = TestNodeConfig(return_status_script="cup == 'mug' ? FAILURE : SUCCESS")
    run = simulate(
        TREE.replace('target="{cup}"', 'target="{cup}" cup="{cup}"'),
        registry,
        substitutions=SubstitutionRules({"Grasp": config}),
    )
    assert run.status == FAILURE


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[", "not JSON"),
        ("{}", "'SubstitutionRules'"),
        ('{"TestNodeConfigs": {"a": {}}, "SubstitutionRules": {}}', "must contain return_status"),
        ('{"TestNodeConfigs": {"a": {"return_status": "DONE"}}, "SubstitutionRules": {}}', "is 'DONE'; accepted are"),
        ('{"TestNodeConfigs": {"a": {"status": 1}}, "SubstitutionRules": {}}', "unknown fields"),
        ('{"TestNodeConfigs": {"a": 3}, "SubstitutionRules": {}}', "must be an object but is 3"),
        ('{"TestNodeConfigs": [1], "SubstitutionRules": {}}', r"must be an object but is \[1\]"),
        ('{"SubstitutionRules": {"A": null}}', "SubstitutionRules 'A': should be the name of a node or .*, got None"),
        ('{"SubstitutionRules": {"A": {"x": 1}}}', r"SubstitutionRules 'A': should be the name .*, got {'x': 1}"),
        *(
            (
                f'{{"TestNodeConfigs": {{"a": {{"return_status": "SUCCESS", "{script}": "x ="}}}}, '
                '"SubstitutionRules": {}}',
                f"TestNodeConfig 'a': {script}: .*x =",
            )
            for script in ("return_status_script", "success_script", "failure_script", "post_script")
        ),
    ],
)
def test_rules_that_are_not_well_formed_are_refused(text: str, message: str) -> None:
    with pytest.raises(SubstitutionError, match=message):
        SubstitutionRules.from_json(text)


def test_a_rule_that_names_an_unknown_node_is_refused(registry: NodeRegistry) -> None:
    message = "^SubstitutionRules 'first': 'Nothing', the replacement of 'pick/first', is not registered"
    with pytest.raises(SubstitutionError, match=message):
        load_tree(TREE, registry, substitutions=SubstitutionRules({"first": "Nothing"}))


def test_a_node_may_take_the_place_of_another_and_the_first_rule_that_fits_counts(registry: NodeRegistry) -> None:
    rules = SubstitutionRules({"pick/*": "AlwaysFailure", "second": "AlwaysSuccess", "Grasp": "AlwaysSuccess"})
    tree = load_tree(TREE, registry, substitutions=rules)
    assert [node.type_id for node in tree.nodes if node.name in ("first", "second")] == ["AlwaysFailure"] * 2
    tree = load_tree(TREE, registry, substitutions=SubstitutionRules({"second": "AlwaysSuccess", "pick/*": "Grasp"}))
    assert [node.type_id for node in tree.nodes if node.name in ("first", "second")] == ["Grasp", "AlwaysSuccess"]


def test_delays_of_rules_are_milliseconds_and_numbers(registry: NodeRegistry) -> None:
    rule = {"return_status": "FAILURE", "async_delay": 1500, "post_script": "n := 1"}
    text = {"TestNodeConfigs": {"slow": rule}, "SubstitutionRules": {"first": "slow", "second": "AlwaysSuccess"}}
    config = SubstitutionRules.from_json(text).rules["first"]
    assert config == TestNodeConfig(return_status=FAILURE, async_delay=1.5, post_script="n := 1")
    rule["async_delay"] = "1500"
    with pytest.raises(SubstitutionError, match="async_delay must be milliseconds but is '1500'"):
        SubstitutionRules.from_json(text)


def test_a_hint_names_an_entry_only_where_it_would_help(tmp_path: Path, registry: NodeRegistry) -> None:
    path = file(
        tmp_path,
        '<Sequence><Script code="mug := 1; cup := 2"/><SubTree ID="Pick" hand="{gone}"/><Grasp target="{cub}"/>'
        "</Sequence>",
        '<BehaviorTree ID="Pick"><Sequence><Grasp target="{cap}"/><Grasp target="{hand}"/><Script code="cab := 1"/>'
        "</Sequence></BehaviorTree>",
    )
    hints = [problem.suggestion for problem in validate_file(path, registry)]
    assert sorted(hints) == ["", "did you mean '{cab}'?", "did you mean '{cup}'?"]


def test_literals_shadow_nothing_where_nothing_is_shared(tmp_path: Path, registry: NodeRegistry) -> None:
    inner = '<BehaviorTree ID="A"><Script code="x := name"/></BehaviorTree>'
    script = "<Script code=\"speed := 1; name := 'a'\"/>"
    for subtree in (
        '<SubTree ID="A" name="b" _autoremap="true"/>',
        '<SubTree ID="A" _autoremap="true" speed="{speed}"/>',
        '<SubTree ID="A" _autoremap="false" speed="2"/>',
        '<SubTree ID="A" _autoremap="true" other="2"/>',
    ):
        path = file(tmp_path, f"<Sequence>{script}{subtree}</Sequence>", inner)
        assert [message for message in found(path, registry) if "shadows" in message] == []


def test_the_text_view_shows_structure_ports_and_states(registry: NodeRegistry) -> None:
    run = simulate(TREE, registry, substitutions=rules())
    assert render_text(run.tree, ports=False) == (
        "Sequence 'fetch'\n"
        "├── Script 'init'\n"
        "├── SubTree Pick 'pick'\n"
        "│   └── Fallback\n"
        "│       ├── TestNode 'first'\n"
        "│       └── TestNode 'second'\n"
        "└── ScriptCondition\n"
    )
    lines = render_text(run.tree, current_states(run.tree)).splitlines()
    assert lines[4] == "│       ├── ✗ TestNode 'first'  target={target} width={width}  [FAILURE]"


def test_the_svg_is_well_formed_and_shows_every_node_inside_the_picture(registry: NodeRegistry) -> None:
    tree = load_tree(TREE, registry)
    svg = ElementTree.fromstring(render_svg(tree, current_states(tree)))
    space = "{http://www.w3.org/2000/svg}"
    width, height = float(svg.get("width", 0)), float(svg.get("height", 0))
    boxes = [group.find(f"{space}rect") for group in svg.iter(f"{space}g")]
    assert len(boxes) == len(tree.nodes)
    frames = [tuple(float(box.get(k)) for k in ("x", "y", "width", "height")) for box in boxes]
    assert all(x >= 0 and y >= 0 and x + w <= width and y + h <= height for x, y, w, h in frames)
    for i, (x, y, w, h) in enumerate(frames):
        for x2, y2, w2, h2 in frames[i + 1 :]:
            assert x + w <= x2 or x2 + w2 <= x or y + h <= y2 or y2 + h2 <= y


def test_the_dot_view_has_a_line_for_each_node_and_edge(registry: NodeRegistry) -> None:
    tree = load_tree(TREE, registry)
    dot = render_dot(tree)
    assert len(re.findall(r"^  n\d+ \[", dot, re.M)) == len(tree.nodes)
    assert len(re.findall(r" -> ", dot)) == len(tree.nodes) - 1


def test_the_port_map_tells_who_maps_writes_and_reads_what(registry: NodeRegistry) -> None:
    assert render_ports(load_tree(TREE, registry)) == (
        "Main\n"
        "  cup: str\n"
        "    written by init.code\n"
        "    read by    pick/first.target as target, pick/second.target as target\n"
        "  opening: float\n"
        "    written by pick/first.width as width, pick/second.width as width\n"
        "    read by    ScriptCondition::7.code\n"
        "Pick (pick)\n"
        "  target = {cup} of Main\n"
        "  width = {opening} of Main\n"
    )


def test_a_validated_python_tree_reports_its_errors(tmp_path: Path, registry: NodeRegistry) -> None:
    path = tmp_path / "tree.py"
    path.write_text(
        "from bestman_bt.engine import Repeat, AlwaysSuccess\ndef build():\n    return Repeat(AlwaysSuccess())\n"
    )
    assert [p.field for p in validate_file(path, registry)] == ["num_cycles"]
    path.write_text("from bestman_bt.engine import AlwaysSuccess\ndef build():\n    return AlwaysSuccess()\n")
    assert validate_file(path, registry) == []
    assert load_tree(path).tick_exactly_once() == SUCCESS


def test_what_fails_only_once_it_is_ticked_loads_and_is_reported(tmp_path: Path, registry: NodeRegistry) -> None:
    body = (
        "<Fallback>\n<AlwaysSuccess/>\n<Repeat><AlwaysSuccess/></Repeat>\n<IfThenElse><AlwaysSuccess/></IfThenElse>\n"
        '<Script code="3 := a"/>\n</Fallback>'
    )
    path = file(tmp_path, body, '<BehaviorTree ID="Unused">\n<Repeat num_cycles="many"><AlwaysSuccess/></Repeat>\n'
                "</BehaviorTree>\n")  # fmt: skip
    assert load_tree(path, registry).tick_exactly_once() == SUCCESS
    assert found(path, registry) == [
        "tree.xml:5: error once it is ticked: <Repeat> port 'num_cycles': it is required but not given (of type int)",
        "tree.xml:6: error once it is ticked: <IfThenElse>: it must have at least 2 children but has 1",
        "tree.xml:7: error once it is ticked: <Script> port 'code': only a blackboard key can be assigned to, "
        "in '3 := a'",
        "tree.xml:10: warning: <BehaviorTree> 'ID': tree 'Unused' is never used",
        "tree.xml:11: error once it is ticked: <Repeat> port 'num_cycles': 'many' is not an int",
    ]


@pytest.mark.parametrize(
    ("node", "told"),
    [
        (
            '<Sleep msec="2 s"/>',
            "<Sleep> port 'msec': '2 s' is not accepted: give a whole number alone, without a unit",
        ),
        ('<Delay delay_msec="0.5"><AlwaysSuccess/></Delay>', "'0.5' is not accepted: give a whole number alone"),
        ('<Timeout msec="1e3"><AlwaysSuccess/></Timeout>', "'1e3' is not accepted: give a whole number alone"),
        ('<Sleep msec="-100"/>', "<Sleep> port 'msec': -100 is not accepted, but a whole number of 0 or more"),
        ('<Delay delay_msec="-5"><AlwaysSuccess/></Delay>', "-5 is not accepted, but a whole number of 0 or more"),
        ('<Timeout msec="-1"><AlwaysSuccess/></Timeout>', "-1 is not accepted, but a whole number of 0 or more"),
        ('<Repeat num_cycles="-3"><AlwaysSuccess/></Repeat>', "num_cycles is -3; 0 or more is accepted, or -1"),
        ('<RetryUntilSuccessful num_attempts="-2"><AlwaysSuccess/></RetryUntilSuccessful>', "num_attempts is -2; 0 or"),
        ('<Parallel success_count="7"><AlwaysSuccess/></Parallel>', "success_count is 7 but there is 1 child"),
        ('<Parallel failure_count="2"><AlwaysSuccess/></Parallel>', "failure_count is 2 but there is 1 child"),
        ('<ParallelAll max_failures="2"><AlwaysSuccess/></ParallelAll>', "max_failures is 2 but there is 1 child"),
    ],
)
def test_a_number_with_a_unit_or_out_of_range_is_refused(
    node: str, told: str, tmp_path: Path, registry: NodeRegistry
) -> None:
    path = file(tmp_path, node)
    assert told in "\n".join(found(path, registry))
    with pytest.raises(TreeLoadError, match=re.escape(told)):
        load_tree(path, registry)
    if "Sleep" in node:
        with pytest.raises(TreeLoadError, match="'2 s' is not accepted"):
            build_tree(Sleep(msec="2 s"))


@pytest.mark.parametrize(
    "node",
    [
        '<Repeat num_cycles="-1"><AlwaysSuccess/></Repeat>',
        '<Repeat num_cycles="0"><AlwaysSuccess/></Repeat>',
        '<RetryUntilSuccessful num_attempts="-1"><AlwaysSuccess/></RetryUntilSuccessful>',
        '<Parallel success_count="-7" failure_count="1"><AlwaysSuccess/></Parallel>',
        '<Parallel success_count="{n}"><AlwaysSuccess/></Parallel>',
        '<Sleep msec="0"/>',
    ],
)
def test_numbers_that_behaviortree_cpp_takes_load(node: str, tmp_path: Path, registry: NodeRegistry) -> None:
    assert load_tree(file(tmp_path, node), registry).nodes


def test_a_timeout_of_zero_is_warned_of(tmp_path: Path, registry: NodeRegistry) -> None:
    path = file(tmp_path, '<Timeout msec="0"><AlwaysSuccess/></Timeout>')
    assert found(path, registry) == ["tree.xml:3: warning: <Timeout> port 'msec': 0 means that it never times out"]


def test_two_trees_of_one_id_are_an_error_with_both_lines_and_hide_nothing(
    tmp_path: Path, registry: NodeRegistry
) -> None:
    twice = '<BehaviorTree ID="Inner">\n<Grisp/>\n</BehaviorTree>\n<BehaviorTree ID="Inner"><Grosp/></BehaviorTree>\n'
    path = file(tmp_path, '<SubTree ID="Inner"/>', twice)
    assert found(path, registry) == [
        "tree.xml:6: <Grisp>: unknown node 'Grisp' (did you mean 'Grasp'?)",
        "tree.xml:8: <BehaviorTree> 'ID': 'Inner' is also the ID of the tree in line 5; rename one of them",
        "tree.xml:8: <Grosp>: unknown node 'Grosp' (did you mean 'Grasp'?)",
    ]
    with pytest.raises(TreeLoadError, match="the tree in line 5"):
        load_tree(path, registry)


def test_a_tree_that_replaces_an_included_one_is_warned_of(tmp_path: Path, registry: NodeRegistry) -> None:
    inner = '<BehaviorTree ID="Inner"><AlwaysFailure/></BehaviorTree>'
    (tmp_path / "parts.xml").write_text(f'<root BTCPP_format="4">{inner}</root>')
    more = '<include path="parts.xml"/>' + inner.replace("AlwaysFailure", "AlwaysSuccess")
    path = file(tmp_path, '<SubTree ID="Inner"/>', more)
    assert "'Inner' is already defined at" in "\n".join(found(path, registry))
    assert load_tree(path, registry).tick_exactly_once() == SUCCESS


def test_what_behaviortree_cpp_accepts_without_a_word_is_warned_of(tmp_path: Path, registry: NodeRegistry) -> None:
    body = (
        '<Sequence>\n<Repeat num_cycles="3abc"><AlwaysSuccess/></Repeat>\n<Grasp target="mug" width="7"/>\n'
        '<Action ID="Sequence"><AlwaysSuccess/></Action>\n<SubTree ID="Inner" size="{@size}"/>\n</Sequence>'
    )
    more = '<BehaviorTree ID="Inner">\n<Grasp target="cup" width="{size}"/>\n</BehaviorTree>\n<Metadata/>\n'
    messages = found(file(tmp_path, body, more), registry)
    assert [message for message in messages if ": warning: " not in message] == []
    told = "\n".join(messages)
    for expected in (
        "tree.xml:4: warning: <Repeat> port 'num_cycles': only the beginning of '3abc' is read as a number",
        "tree.xml:5: warning: <Grasp> port 'width': nothing is written: an output port is mapped to an entry, as "
        "'{width}', not to '7'",
        "tree.xml:6: warning: <Sequence>: 'Sequence' is of kind Control, not Action (write <Control ID=\"Sequence\">)",
        "<Metadata>: it is ignored",
        "its writes to '{size}' do not reach '@size', to which the SubTree maps it (write to '{@size}' itself)",
    ):
        assert expected in told


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<SubTree ID="Inner"><AlwaysFailure/></SubTree>', "<SubTree>: a <SubTree> has no children of its own"),
        ('<SubTree ID="Nowhere"><Sleep ms="1"/></SubTree>', "<SubTree>: a <SubTree> has no children of its own"),
        ('<Condition ID="Cold"><AlwaysSuccess/></Condition>', "<Cold>: it must not have children but has 1"),
        ('<Action ID="Wipe"><AlwaysSuccess/></Action>', "<Wipe>: it must not have children but has 1"),
        ('<BehaviorTree ID="C"><AlwaysSuccess/></BehaviorTree>', "<BehaviorTree>: it is not a node"),
        ("<TreeNodesModel/>", "<TreeNodesModel>: it is not a node"),
        ('<Wipe ID="x"/>', "<Wipe> 'ID': the attribute is not allowed here (write <Action ID=\"Wipe\">)"),
        ('<AlwaysSuccess ID="x"/>', "'ID': the attribute is not allowed here (write <Action ID=\"AlwaysSuccess\">)"),
        ("<x_:Wipe/>", "<x_:Wipe>: the name of a node has no ':'"),
    ],
)
def test_what_is_wrong_in_every_behaviortree_cpp_is_an_error_and_drawn(body: str, message: str, tmp_path: Path) -> None:
    inner = '<BehaviorTree ID="Inner"><AlwaysSuccess/></BehaviorTree>'
    path = file(tmp_path, f"<Sequence><AlwaysSuccess/>\n{body}</Sequence>", inner)
    problems = [one for one in validate_file(path) if one.severity == "error" and not one.missing]
    assert any(str(one).endswith(message) for one in problems), problems
    faults: list[TreeProblem] = []
    assert len(open_tree(path, faults=faults).nodes) > 1
    assert any(str(one).endswith(message) for one in faults)
    with pytest.raises(TreeLoadError):
        load_tree(path)


def test_a_wrong_script_of_a_node_without_code_is_reported_once(tmp_path: Path) -> None:
    problems = validate_file(file(tmp_path, '<Wipe _skipIf="x ="/>'))
    assert [one.field for one in problems if one.severity == "error" and not one.missing] == ["_skipIf"]
    assert len(problems) == 2


def test_a_node_that_version_4_renamed_is_suggested_by_its_new_name(tmp_path: Path) -> None:
    (problem,) = validate_file(file(tmp_path, "<SequenceStar><AlwaysSuccess/></SequenceStar>"))
    assert problem.suggestion == "version 4 calls it SequenceWithMemory"


def test_what_no_behaviortree_cpp_takes_is_reported_as_not_portable(tmp_path: Path) -> None:
    path = file(
        tmp_path, """<Sequence><Script code='a := "x"'/>\n<Script code="b := 'it said &quot;x&quot;'"/></Sequence>"""
    )
    told = [str(problem) for problem in validate_file(path)]
    assert ["not portable" in line for line in told] == [True], told
    (tmp_path / "t.py").write_text("import py_trees\n\ndef build():\n    return py_trees.behaviours.Success('yes')\n")
    (problem,) = validate_file(tmp_path / "t.py")
    assert (problem.severity, problem.message) == (
        "warning",
        "not portable: BehaviorTree.CPP has no leaves of py_trees",
    )


@pytest.mark.parametrize(
    ("node", "field"),
    [
        ('<Repeat num_cycles="3000000000"><AlwaysSuccess/></Repeat>', "num_cycles"),
        ('<Sleep msec="5000000000"/>', "msec"),
        ('<Sequence><Script code="c := 1"/>\n<Script code="{c}"/></Sequence>', "code"),
        ('<LoopInt queue="1;2" value="="><AlwaysSuccess/></LoopInt>', "value"),
    ],
)
def test_what_behaviortree_cpp_refuses_and_loads_here_is_not_portable(node: str, field: str, tmp_path: Path) -> None:
    problems = [one for one in validate_file(file(tmp_path, node)) if "not portable" in one.message]
    assert [(one.field, one.severity) for one in problems] == [(field, "warning")]
    assert not validate_file(file(tmp_path, '<Delay delay_msec="4294967295"><AlwaysSuccess/></Delay>'))


def test_utf_16_is_not_portable(tmp_path: Path) -> None:
    path = file(tmp_path, "<AlwaysSuccess/>")
    path.write_bytes(path.read_text().encode("utf-16"))
    (problem,) = validate_file(path)
    assert (problem.severity, problem.message) == ("warning", "not portable: BehaviorTree.CPP reads UTF-8")


def test_an_error_of_a_node_has_the_way_of_the_tick(tmp_path: Path) -> None:
    body = '<Sequence name="top"><Inverter><Script name="bad" code="a := 1; a = \'x\'"/></Inverter></Sequence>'
    path = file(tmp_path, body)
    tree = load_tree(path)
    with pytest.raises(NodeError) as error:
        tree.tick_exactly_once()
    kinds = [line.rpartition("[")[2].rstrip("]") for line in error.value.backtrace]
    assert kinds == ["Sequence", "Inverter", "Script"]
    assert all(path.name in line for line in error.value.backtrace)
    run = simulate(path, scenario=Scenario())
    assert "the tick went through top" in run.error
