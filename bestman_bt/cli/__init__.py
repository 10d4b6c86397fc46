"""The ``bestman-bt`` command, one file per verb."""
