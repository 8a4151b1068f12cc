#!/bin/sh
# In place of `sbatch --wait`: runs the elements of an array one after another. The first element of the first array is
# lost with its node.
# Usage: fake_sbatch.sh MARK --array=0-LAST SCRIPT [argument...]   MARK: a file that says that one was lost
set -eu
mark="$1" last="${2#--array=0-}"
shift 2
failed=0
index=0
while [ "$index" -le "$last" ]; do
  if [ "$index" -eq 0 ] && [ ! -e "$mark" ]; then
    touch "$mark"
    failed=1
  else
    SLURM_ARRAY_TASK_ID="$index" SLURM_ARRAY_TASK_COUNT="$((last + 1))" "$@" || failed=1
  fi
  index=$((index + 1))
done
exit "$failed"
