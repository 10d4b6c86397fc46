"""What subtrees declare of themselves in their file: read, and told with its line where it cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.engine import NodeRegistry, TreeLoadError
from bestman_bt.task_planning.abilities import Ability, DeclarationError, abilities_of
from bestman_bt.task_planning.domain import Domain

SUBTREE = """<root BTCPP_format="4">
  <BehaviorTree ID="Wipe"><AlwaysSuccess/></BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="Wipe">
      <input_port name="place" type="place">what is wiped</input_port>
      <MetadataFields>
        <Metadata description="wipe a place"/>
        <Metadata pre="hand_empty" cost="2.5"/>
        <Metadata effects="clean({place})" parts="base arm"/>
      </MetadataFields>
    </SubTree>
    <SubTree ID="Helper"><MetadataFields><Metadata author="me"/></MetadataFields></SubTree>
  </TreeNodesModel>
</root>"""


def read(folder: Path, old: str = "", new: str = "") -> tuple[Ability, ...]:
    """The abilities of a file in which something was changed."""
    assert old in SUBTREE
    file = folder / "wipe.xml"
    file.write_text(SUBTREE.replace(old, new) if old else SUBTREE, encoding="utf-8")
    return abilities_of(NodeRegistry(), [file])


def test_a_subtree_is_read_with_its_ports_costs_and_parts(tmp_path: Path) -> None:
    (ability,) = read(tmp_path)
    operator = ability.operator
    assert (ability.name, ability.is_subtree, ability.description) == ("Wipe", True, "wipe a place")
    assert (operator.parameters, operator.cost, operator.parts) == ({"place": "place"}, 2.5, ("base", "arm"))
    assert [str(one) for one in (*operator.pre, *operator.effects)] == ["hand_empty", "clean({place})"]


def test_what_an_ability_takes_away_and_what_it_does_for_each_are_read(tmp_path: Path) -> None:
    effects = "clean({place}) and not hand_empty and forall p - place: not unseen(mug, p)"
    (ability,) = read(tmp_path, 'effects="clean({place})"', f'effects="{effects}"')
    operator = ability.operator
    assert [str(fact) for fact in operator.add] == ["clean({place})"]
    assert [str(fact) for fact in operator.delete] == ["hand_empty"]
    assert [str(each) for each in operator.each] == ["forall p - place: not unseen(mug, p)"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('cost="2.5"', 'cost="0"', ":8: Wipe: cost is 0.0; more than 0 is accepted"),
        ('cost="2.5"', 'cost="inf"', ":8: Wipe: cost is inf; more than 0 is accepted"),
        ('cost="2.5"', 'cost="dear"', ":8: Wipe: cost is 'dear'; a number is accepted"),
        ('cost="2.5"', 'cost="-1"', ":8: Wipe: cost is -1.0; more than 0 is accepted"),
        ('cost="2.5"', 'cost="nan"', ":8: Wipe: cost is nan; more than 0 is accepted"),
        ("clean({place})", "clean({plaec})", ":9: Wipe: effects: clean({plaec}): no parameter {plaec}; place"),
        ("clean({place})", "clean({place}", ":9: Wipe: effects: column"),
        ("effects=", "effcts=", ":9: Wipe: unknown 'effcts'; did you mean 'effects'?"),
    ],
)
def test_what_cannot_be_read_is_reported_with_its_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(DeclarationError) as raised:
        read(tmp_path, old, new)
    assert str(raised.value).startswith(f"{tmp_path / 'wipe.xml'}{words}")


@pytest.mark.parametrize(
    ("old", "new", "line"), [(' name="place"', "", 5), (' ID="Helper"', "", 12), ("</MetadataFields>\n", "\n", 11)]
)
def test_a_model_that_is_no_model_is_reported_with_its_line(tmp_path: Path, old: str, new: str, line: int) -> None:
    with pytest.raises(TreeLoadError) as raised:
        read(tmp_path, old, new)
    assert raised.value.problems[0].line == line


def test_a_port_of_another_type_than_its_predicate_takes_is_reported(tmp_path: Path) -> None:
    abilities = read(tmp_path, 'effects="clean({place})"', 'effects="open({place})"')
    with pytest.raises(DeclarationError, match=r"Wipe: open\(\{place\}\): open takes container"):
        Domain(abilities)
