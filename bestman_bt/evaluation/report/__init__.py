"""Reports of runs: one HTML file that tells what happened, readable without scripts and without a network."""
