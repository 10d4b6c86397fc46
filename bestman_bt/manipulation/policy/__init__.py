"""Learning-based manipulation: policies that give action chunks, and the motion that they make."""
