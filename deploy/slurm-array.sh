#!/bin/bash
# A job array of Slurm: each task records its share of the episodes into one dataset.
#   sbatch --array=1-16 deploy/slurm-array.sh config.yaml /shared/dataset
# The dataset's folder is one that all nodes mount, with hard links. The same command again records
# what is missing; a task that was ended is started again by Slurm (--requeue) and does the same.
#SBATCH --job-name=carstage
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=8
#SBATCH --mem=16G
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:INT@60
#SBATCH --output=carstage-%A_%a.log
set -euo pipefail

if [ "$#" -lt 2 ]; then
  echo "usage: sbatch --array=1-N slurm-array.sh CONFIG DATASET [OPTION...]" >&2
  exit 2
fi
config=$1
dataset=$2
shift 2

# Slurm numbers tasks from SLURM_ARRAY_TASK_MIN on; shares begin with 1.
share=$((SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN + 1))/$SLURM_ARRAY_TASK_COUNT

# Towns and machine code are kept on the node: all tasks of a user on it share them.
export CARSTAGE_CACHE_DIR=${CARSTAGE_CACHE_DIR:-${TMPDIR:-/tmp}/carstage-$(id -u)}

# In place of this shell, so that Slurm's signal reaches the run: it ends well, within ten seconds.
exec carstage run "$config" --out "$dataset" --shard "$share" --workers auto "$@"
