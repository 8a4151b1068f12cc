#!/bin/sh
# A bake by job arrays gives the archive of the local bake, also where an element is lost, and ends where none gets on.
# Usage: job_array_test.sh GLINT SLURM_FOLDER
set -eu
glint="$1" slurm="$2" here="$(cd "$(dirname "$0")" && pwd)"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
words="--directions 42 --layers 1 --layer-tolerance 0 --estimate 0 --max-rays 256 --vertices-per-task 60"
"$glint" scene planes --vertices 500 -o "$folder/scene.glb"
# shellcheck disable=SC2086  # words
"$glint" bake "$folder/scene.glb" -o "$folder/local.glint" --quiet $words

export GLINT="$glint" ELEMENTS=3
# shellcheck disable=SC2086
SBATCH="$here/fake_sbatch.sh $folder/lost" "$slurm/bake-array.sh" "$folder/scene.glb" "$folder/array.glint" "$folder/work" $words
test -e "$folder/lost"
cmp "$folder/local.glint" "$folder/array.glint"

# Arrays that never do anything.
code=0
SBATCH=false ROUNDS=2 "$slurm/bake-array.sh" "$folder/scene.glb" "$folder/never.glint" "$folder/idle" || code=$?
test "$code" -eq 1
test ! -e "$folder/never.glint"
