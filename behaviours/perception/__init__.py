"""Skills that look: detecting, scanning, searching, tidying, and beliefs made of what was seen."""
