"""The composition root: builds robot, beliefs, algorithms, skills and a running tree from a configuration."""

from bestman_bt.extras import refuse_hidden_packages

refuse_hidden_packages()
