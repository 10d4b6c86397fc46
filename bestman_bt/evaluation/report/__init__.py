"""Reports of runs: one HTML file that is readable without scripts and network."""
