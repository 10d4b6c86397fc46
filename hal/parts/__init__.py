"""Building blocks of parts: control of joints, grippers and bases over channels, motions, command checks."""
