"""Views of a run: Rerun recordings and the live tree on a terminal."""
