"""Timed joint trajectories."""
