"""MuJoCo as an engine of the simulated robot: the same worlds, robots, sensors and audit as in PyBullet."""
