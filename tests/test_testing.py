"""What users have for tests of their trees."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.testing import TreeTester, assert_halted, assert_order

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Fallback>
<Timeout msec="1000"><Grasp name="first"/></Timeout><Sequence><Look/><Grasp name="again"/></Sequence>
</Fallback></BehaviorTree></root>"""


def test_a_tree_is_tested_without_its_leaves(tmp_path: Path) -> None:
    (tmp_path / "t.xml").write_text(TREE)
    tester = TreeTester(tmp_path / "t.xml")
    assert tester.run().succeeded
    with pytest.raises(AssertionError, match=r"50% of the nodes began, never: Sequence::4"):
        tester.assert_coverage(0.9)
    run = tester.run({"first": {"duration": 5.0}})
    assert run.succeeded
    assert_halted(run, "first")
    assert_order(run, "first", "Look::5", "again")
    tester.assert_coverage(1.0)
    with pytest.raises(AssertionError, match="'first' did not begin after"):
        assert_order(run, "again", "first")
    with pytest.raises(AssertionError, match="'again' was not halted, but"):
        assert_halted(run, "again")
