#!/bin/sh
# Bakes with job arrays: one array a layer, whose elements run `glint run-task`. No queue and no workers; every task loads
# its layer anew, so this is for tasks of minutes (--vertices-per-task). Killed at any moment, the same command goes on.
# Usage: deploy/slurm/bake-array.sh SCENE OUT.glint WORK_FOLDER [word of `glint bake`...]
#   WORK_FOLDER  that all nodes share
#   GLINT        the program, the same on all nodes (default: glint)     ELEMENTS  of an array at most (default: 1000)
#   SBATCH       what submits an array and waits for its end (default: sbatch --wait)
#   ROUNDS       without a finished task after which it gives up (default: 3)
set -eu
if [ $# -lt 3 ]; then
  sed -n '/^# Usage/,/^set/p' "$0" | sed '$d; s/^# //' >&2
  exit 2
fi
scene="$1" out="$2" work="$3"
shift 3
here="$(cd "$(dirname "$0")" && pwd)"
glint="${GLINT:-glint}"
sbatch="${SBATCH:-sbatch --wait}"
elements="${ELEMENTS:-1000}"
patience="${ROUNDS:-3}"
mkdir -p "$work"
said="$work/bake-array.said"
list="$work/bake-array.tasks"

# What `glint bake --executor manual` asks for at its end: "... --manifest M --store S --index I' for I = 0-3,7"
asked() {
  sed -n "s|.*run-task --manifest \(.*\) --store \(.*\) --index I' for I = \([0-9,-]*\).*|\\$1|p" "$said"
}

last="" rounds=0
while :; do
  code=0
  "$glint" bake "$scene" -o "$out" --work-dir "$work" --executor manual "$@" 2> "$said" || code=$?
  cat "$said" >&2
  if [ "$code" -ne 5 ]; then
    rm -f "$said" "$list"
    exit "$code"
  fi
  ranges="$(asked 3)"
  if [ -z "$ranges" ]; then
    exit 5 # interrupted by somebody
  fi
  rounds=$((rounds + 1))
  if [ "$(asked 1) $ranges" != "$last" ]; then
    rounds=0
  elif [ "$rounds" -ge "$patience" ]; then
    echo "no task of the layer was finished by $rounds arrays; see their output" >&2
    exit 1
  fi
  last="$(asked 1) $ranges"
  echo "$ranges" | tr ',' '\n' | awk -F- '{ for (i = $1; i <= $NF; ++i) print i }' > "$list"
  count="$(wc -l < "$list")"
  if [ "$count" -gt "$elements" ]; then
    count="$elements"
  fi
  # Elements may fail: the next look says what is missing.
  # shellcheck disable=SC2086  # words of a command
  $sbatch --array="0-$((count - 1))" "$here/run-tasks.sh" "$glint" "$(asked 1)" "$(asked 2)" "$list" || true
done
