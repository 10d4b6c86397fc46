"""Walking on four legs: kinematics, gait, attitude, odometry; pure functions, for torque-controlled drivers."""
