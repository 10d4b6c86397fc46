"""Who runs the episodes of an evaluation: processes of this machine, a Ray cluster, Slurm, or a launcher of yours."""
