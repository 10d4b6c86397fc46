"""Perception: from RGB-D images to surfaces, objects with poses, and grasps; arrays and messages in, never a robot."""
