"""Facts about the world, one file each: their belief and their ground truth."""
