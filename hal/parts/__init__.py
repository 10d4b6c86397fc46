"""What parts of any make are built from: the laws of joints, grippers and bases over channels, motions, checks."""
