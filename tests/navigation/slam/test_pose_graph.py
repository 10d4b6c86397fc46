from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph

TIGHT = np.diag([1e4, 1e4, 1e5])


def square_walk(rng, sides=4, steps=10, noise=(0.01, 0.01, 0.01)):
    """A walk round a square of 5 m and back to its start: true poses, and a graph by noisy odometry."""
    true = [Pose2D()]
    graph = PoseGraph()
    graph.add_pose(true[0])
    for step in range(sides * steps):
        turn = np.pi / 2 if step % steps == steps - 1 else 0.0
        move = Pose2D(0.5, 0.0, turn)
        true.append(true[-1] @ move)
        measured = move @ Pose2D(*(rng.standard_normal(3) * noise))
        node = graph.add_pose(graph.pose(step) @ measured)
        graph.add_constraint(Constraint(step, node, measured, np.diag(1.0 / np.square(noise))))
    return true, graph


def worst(graph, true):
    return max(graph.pose(k).distance_to(pose) for k, pose in enumerate(true))


def test_a_loop_closure_takes_most_of_the_drift_away():
    drifted, closed = [], []
    for seed in range(5):
        true, graph = square_walk(np.random.default_rng(seed), noise=(0.01, 0.01, 0.03))
        graph.optimize()
        drifted.append(worst(graph, true))
        graph.add_constraint(Constraint(0, len(true) - 1, true[-1], TIGHT, doubtful=True))
        graph.optimize()
        closed.append(worst(graph, true))
    assert np.mean(closed) < 0.6 * np.mean(drifted)


def test_later_nodes_go_with_the_last_of_those_that_an_optimisation_has_moved():
    graph = PoseGraph()
    before = [Pose2D(), Pose2D(1.0, 0.2, 0.3), Pose2D(2.0, 0.5, 0.9), Pose2D(2.4, 1.3, 1.4), Pose2D(2.2, 2.0, 2.5)]
    for pose in before:
        graph.add_pose(pose)
    moved = [Pose2D(), Pose2D(1.1, 0.0, -0.2), Pose2D(2.3, -0.4, -0.6)]
    graph.move_to(np.array([[pose.x, pose.y, pose.theta] for pose in moved]))
    later = [moved[2] @ before[2].inverse() @ pose for pose in before[3:]]
    np.testing.assert_allclose(graph.poses, [[pose.x, pose.y, pose.theta] for pose in [*moved, *later]], atol=1e-12)


def test_exact_measurements_are_met_exactly_from_a_wrong_first_guess():
    rng = np.random.default_rng(1)
    true = [Pose2D(*pose) for pose in rng.uniform(-2.0, 2.0, (12, 3))]
    true[0] = Pose2D()
    graph = PoseGraph()
    for pose in true:
        graph.add_pose(Pose2D(*(np.array([pose.x, pose.y, pose.theta]) + rng.normal(0.0, 0.2, 3) * (pose != true[0]))))
    for k in range(12):
        for other in {(k + 1) % 12, (k + 5) % 12}:
            graph.add_constraint(Constraint(k, other, true[k].inverse() @ true[other], TIGHT))
    assert graph.optimize() < 1e-9
    assert worst(graph, true) < 1e-6


def test_a_wrong_loop_closure_does_not_bend_the_map():
    true, graph = square_walk(np.random.default_rng(2))
    graph.add_constraint(Constraint(0, 40, true[40], TIGHT, doubtful=True))
    graph.add_constraint(Constraint(1, 39, true[1].inverse() @ true[39], TIGHT, doubtful=True))
    graph.optimize()
    before = worst(graph, true)
    graph.add_constraint(Constraint(5, 25, Pose2D(0.5, 0.0, 0.0), TIGHT, doubtful=True))
    graph.optimize()
    assert worst(graph, true) < before + 0.05
    assert graph.chi_squares()[-1] > 1e3


def test_the_same_wrong_loop_closure_believed_blindly_bends_it():
    true, graph = square_walk(np.random.default_rng(2))
    graph.add_constraint(Constraint(5, 25, Pose2D(0.5, 0.0, 0.0), TIGHT))
    graph.optimize()
    assert worst(graph, true) > 1.0


def test_covariance_grows_along_a_chain_as_the_sum_of_its_steps():
    graph = PoseGraph()
    graph.add_pose(Pose2D())
    step = np.diag([0.01, 0.02, 0.001]) ** 2
    for k in range(5):
        graph.add_pose(Pose2D(1.0 * (k + 1), 0.0, 0.0))
        graph.add_constraint(Constraint(k, k + 1, Pose2D(1.0, 0.0, 0.0), np.linalg.inv(step)))
    covariance = graph.relative_covariance(1, 4)
    assert covariance[0, 0] == pytest.approx(3 * step[0, 0])
    assert covariance[2, 2] == pytest.approx(3 * step[2, 2])
    # A heading error of an early step moves what comes after it: 2 m and 1 m of lever.
    assert covariance[1, 1] == pytest.approx(3 * step[1, 1] + (2**2 + 1**2) * step[2, 2])
    assert graph.relative_covariance(0, 2)[0, 0] == pytest.approx(2 * step[0, 0])


def test_jacobians_are_the_derivatives_of_the_errors():
    from bestman_bt.navigation.slam.pose_graph import ConstraintArrays

    rng = np.random.default_rng(3)
    poses = rng.uniform(-1.0, 1.0, (2, 3))
    edges = ConstraintArrays([Constraint(0, 1, Pose2D(*rng.uniform(-1.0, 1.0, 3)), np.eye(3))])
    for end, jacobian in enumerate(edges.jacobians(poses)):
        for coordinate in range(3):
            step = np.zeros((2, 3))
            step[end, coordinate] = 1e-6
            numeric = (edges.errors(poses + step) - edges.errors(poses - step)) / 2e-6
            assert jacobian[0, :, coordinate] == pytest.approx(numeric[0], abs=1e-7)


@pytest.mark.parametrize(("first", "second"), [(0, 1), (0, 0), (-1, 0)])
def test_a_constraint_to_a_node_that_is_not_there_is_refused(first, second):
    graph = PoseGraph()
    graph.add_pose(Pose2D())
    with pytest.raises(ValueError, match="two of the nodes 0 to 0"):
        graph.add_constraint(Constraint(first, second, Pose2D(), np.eye(3)))
