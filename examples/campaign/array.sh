#!/bin/sh
# A campaign as a SLURM job array: find recordings -name '*.h5' | sort > list.txt; sbatch array.sh
# Each job takes every n-th recording of the list. Submitted again, it does what is left.
#SBATCH --job-name=echoset
#SBATCH --array=0-9
#SBATCH --cpus-per-task=2
#SBATCH --mem=4G
#SBATCH --time=04:00:00
set -eu
awk -v n="$SLURM_ARRAY_TASK_COUNT" -v k="$SLURM_ARRAY_TASK_ID" 'NR % n == k % n' list.txt |
    echoset estimate -e "${ESTIMATOR:-eopda-geo}" @- -o estimates/ \
        -j "${SLURM_CPUS_PER_TASK:-1}" --skip-existing --keep-going \
        --summary "summary-$SLURM_ARRAY_TASK_ID.json"
