"""The map from seeds to numbers is a dictionary that is sorted and small."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from bestman_bt.evaluation.seed_map import SeedMap


def test_it_holds_what_a_dictionary_holds_sorted_by_seed() -> None:
    rng = np.random.default_rng(3)
    expected: dict[int, int] = {}
    found = SeedMap()
    for seed, number in rng.integers(0, 200, (300, 2)).tolist():
        expected[seed] = found[seed] = number
        assert (len(found), found[seed]) == (len(expected), number)
    assert list(found.items()) == sorted(expected.items())
    assert [seed in found for seed in range(200)] == [seed in expected for seed in range(200)]
    assert [found.get(seed, -1) for seed in (-1, 200)] == [-1, -1]


def test_it_takes_many_seeds_at_once_in_any_order_and_keeps_the_last_number() -> None:
    for order in (1, -1):
        pairs = np.random.default_rng(3).integers(-200, 200, (300, 2)).tolist()[::order]
        assert list(SeedMap(*zip(*pairs, strict=True)).items()) == sorted(dict(pairs).items())
    assert list(SeedMap([3, 4], [7, 8]).items()) == [(3, 7), (4, 8)]
    assert list(SeedMap().items()) == []


def test_ten_thousand_seeds_take_twenty_bytes_each() -> None:
    tracemalloc.start()
    try:
        found = SeedMap()
        for seed in range(10_000):
            found[seed] = 1000 * seed
        taken, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(found) == 10_000
    assert taken < 20 * len(found)


@pytest.mark.parametrize("held", [{}, {5: 1, 9: 2}])
@pytest.mark.parametrize(("seed", "number"), [(2**63, 0), (-(2**63) - 1, 0), (3, 2**63), (12, -(2**63) - 1)])
def test_a_seed_or_number_that_does_not_fit_is_refused_at_once(held: dict[int, int], seed: int, number: int) -> None:
    found = SeedMap(held.keys(), held.values())
    with pytest.raises(OverflowError):
        found[seed] = number
    assert (len(found), dict(found)) == (len(held), held)
