#!/bin/sh
# An evaluation as an array job that needs no command to follow it; then merge its parts:
#     sbatch --array=1-16 deploy/slurm.sh manipulation /shared/manipulation
#     bestman-bt eval manipulation --merge /shared/manipulation/shards --out /shared/manipulation
#SBATCH --job-name=bestman-bt
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=3G
#SBATCH --time=12:00:00
#SBATCH --requeue
set -eu
exec bestman-bt eval "$1" --shard slurm --out "$2"
