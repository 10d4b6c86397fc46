"""Which results a node can have: told from the tree alone, and never less than what happens."""

from __future__ import annotations

import pytest

from bestman_bt.engine import NodeRegistry, StatefulAction, SyncAction, Tree, load_tree
from bestman_bt.engine.coverage import possible_results, unreachable_children
from tests.engine.planned_leaves import LETTERS

S, F, A, C = "<AlwaysSuccess/>", "<AlwaysFailure/>", "<Act/>", "<Ask/>"
K = '<AlwaysSuccess _skipIf="n == 1"/>'


class Act(StatefulAction):
    pass


class Ask(SyncAction):
    pass


def registry() -> NodeRegistry:
    known = NodeRegistry()
    known.register(Act)
    known.register(Ask)
    return known


def tree(body: str) -> Tree:
    return load_tree(
        '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">'
        f'{body}</BehaviorTree><BehaviorTree ID="Inner"><AlwaysFailure/></BehaviorTree></root>',
        registry(),
    )


@pytest.mark.parametrize(
    ("body", "letters"),
    [
        (S, "S"),
        (F, "F"),
        ('<Script code="n := 1"/>', "S"),
        (A, "RSF"),
        (C, "SF"),
        (K, "SK"),
        ('<AlwaysSuccess _failureIf="n == 1"/>', "SF"),
        ('<AlwaysFailure _successIf="n == 1"/>', "SF"),
        ('<AlwaysFailure _while="n == 1"/>', "FK"),
        ('<SubTree ID="Inner"/>', "F"),
        ('<SubTree ID="Inner" _skipIf="n == 1"/>', "FK"),
        (f"<Inverter>{S}</Inverter>", "F"),
        (f"<Inverter>{F}</Inverter>", "S"),
        (f"<Inverter>{K}</Inverter>", "FK"),
        (f"<ForceSuccess>{F}</ForceSuccess>", "S"),
        (f"<ForceSuccess>{A}</ForceSuccess>", "RS"),
        (f"<ForceFailure>{K}</ForceFailure>", "FK"),
        (f"<ForceFailure>{A}</ForceFailure>", "RF"),
        (f"<KeepRunningUntilFailure>{S}</KeepRunningUntilFailure>", "R"),
        (f"<KeepRunningUntilFailure>{C}</KeepRunningUntilFailure>", "RF"),
        (f'<Repeat num_cycles="-1">{S}</Repeat>', "R"),
        (f'<Repeat num_cycles="-1">{C}</Repeat>', "RF"),
        (f'<Repeat num_cycles="2">{S}</Repeat>', "RSFK"),
        (f'<RetryUntilSuccessful num_attempts="-1">{C}</RetryUntilSuccessful>', "RS"),
        (f'<RetryUntilSuccessful num_attempts="2">{C}</RetryUntilSuccessful>', "RSFK"),
        (f'<Timeout msec="1">{S}</Timeout>', "RSFK"),
        (f"<Sequence>{S}{S}</Sequence>", "S"),
        (f"<Sequence>{S}{F}</Sequence>", "F"),
        (f"<Sequence>{F}{A}</Sequence>", "F"),
        (f"<Sequence>{A}{F}{S}</Sequence>", "RF"),
        (f"<Sequence>{C}{S}</Sequence>", "SF"),
        (f"<Sequence>{K}{F}</Sequence>", "F"),
        (f"<Sequence>{K}{K}</Sequence>", "SK"),
        (f"<Sequence>{K}{S}</Sequence>", "S"),
        (f"<ReactiveSequence>{A}{S}</ReactiveSequence>", "RSF"),
        (f"<Fallback>{F}{F}</Fallback>", "F"),
        (f"<Fallback>{F}{S}{A}</Fallback>", "S"),
        (f"<Fallback>{C}{S}</Fallback>", "S"),
        (f"<Fallback>{C}{A}</Fallback>", "RSF"),
        (f"<Fallback>{K}{F}</Fallback>", "SF"),
        (f"<Parallel>{S}{S}</Parallel>", "RSFK"),
    ],
)
def test_the_results_that_a_node_can_have(body: str, letters: str) -> None:
    assert possible_results(tree(body).root) == {LETTERS[letter] for letter in letters}


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (f"<Sequence>{S}{C}{A}</Sequence>", []),
        (f"<Sequence>{S}{F}{A}{C}</Sequence>", [(4, 3), (5, 3)]),
        (f"<Fallback>{F}{S}{A}</Fallback>", [(4, 3)]),
        (f"<Fallback>{F}{F}{A}</Fallback>", []),
        (f"<Sequence>{K}{A}</Sequence>", []),
        (f'<Sequence><AlwaysFailure _skipIf="n == 1"/>{A}</Sequence>', []),
        (f"<Parallel>{F}{F}{A}</Parallel>", []),
        (f"<Inverter><Sequence>{F}{A}</Sequence></Inverter>", [(4, 3)]),
    ],
)
def test_children_that_can_never_be_ticked_are_named_with_what_is_in_their_way(
    body: str, expected: list[tuple[int, int]]
) -> None:
    assert [(child.uid, sibling.uid) for child, sibling in unreachable_children(tree(body))] == expected
