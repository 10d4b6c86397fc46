"""PyBullet as an engine of the simulated robot: honest physics, no resets, no glue."""
