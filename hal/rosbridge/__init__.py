"""Mobile bases, heads, cameras and other sensors behind a ROS robot, over rosbridge."""
