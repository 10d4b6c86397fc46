"""Detection of known objects by name, and of other objects by label."""
