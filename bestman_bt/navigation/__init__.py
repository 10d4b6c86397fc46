"""Navigation algorithms: pure functions of poses, paths, scans and maps; no robot, no clock."""
