"""PyBullet as an engine of the simulated robot, without pose resets or attachment constraints."""
