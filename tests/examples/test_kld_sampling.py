from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

from examples.plugins.particle_filter import KldSampling

KLD = KldSampling(error=0.02, quantile=2.33, fewest=100, most=20000)


def test_the_count_is_the_quantile_of_the_chi_square_distribution_that_it_approximates():
    for occupied in (10, 50, 300):
        exact = chi2.ppf(0.99, occupied - 1) / (2 * KLD.error)
        assert abs(KLD.enough(occupied) - exact) < 0.01 * exact


def test_more_places_need_more_particles_between_the_fewest_and_the_most():
    assert [KLD.enough(occupied) for occupied in (0, 1)] == [100, 100]
    assert 100 < KLD.enough(2) < KLD.enough(3) < KLD.enough(100)
    assert KLD.enough(5000) == 20000


def test_poses_share_a_bin_where_they_are_near_and_look_the_same_way():
    size, angle = KLD.bin_size, KLD.bin_angle
    poses = np.array(
        [
            (0.1 * size, 0.1 * size, 0.1 * angle),
            (0.9 * size, 0.9 * size, 0.9 * angle),
            (0.1 * size, 0.1 * size, 0.1 * angle + 2 * math.pi),
            (-0.1 * size, 0.1 * size, 0.1 * angle),
            (0.1 * size, 0.1 * size, -0.1 * angle),
            (0.1 * size, 1.1 * size, 0.1 * angle),
        ]
    )
    first, near, same, left, turned, above = KLD.bins(poses)
    assert first == near == same
    assert len({first, left, turned, above}) == 4
