"""Skills of arm and hand: moving, grasping, placing, pushing, running a policy."""
