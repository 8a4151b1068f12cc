#!/bin/sh
# One element of a job array: every STEP-th task of the list, beginning with the element's own.
# Usage: run-tasks.sh GLINT MANIFEST STORE TASKS   TASKS: a file with one task's index a line
#SBATCH --job-name=glint-task
#SBATCH --cpus-per-task=1
#SBATCH --mem=4G
#SBATCH --requeue
set -eu
glint="$1" manifest="$2" store="$3" tasks="$4"
first="$SLURM_ARRAY_TASK_ID"
step="${SLURM_ARRAY_TASK_COUNT:-1}"
# A task that fails leaves the others alone: the next round of the array has it again.
awk -v first="$first" -v step="$step" '(NR - 1) % step == first' "$tasks" | {
  failed=0
  while read -r index; do
    "$glint" run-task --manifest "$manifest" --store "$store" --index "$index" || failed=$?
  done
  exit "$failed"
}
