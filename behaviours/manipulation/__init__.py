"""Skills of arm and hand: moving, grasping, placing, pushing, acting by a policy."""
