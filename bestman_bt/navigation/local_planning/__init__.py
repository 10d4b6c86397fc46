"""Local planning: path followers."""
