"""The composition root: from a configuration to a robot, its beliefs, algorithms and skills, and a running tree."""

from bestman_bt.extras import refuse_hidden_packages

refuse_hidden_packages()
