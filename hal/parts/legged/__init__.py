"""Walking on four legs: kinematics, gait, attitude, odometry; pure, for drivers that command joint torques."""
