"""Detection: known objects by name, and other things by label."""
