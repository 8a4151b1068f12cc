#!/bin/sh
# The cluster of one command bakes what is submitted to it, and leaves no process behind.
# Usage: local_cluster_test.sh GLINT DEPLOY_FOLDER
set -eu
glint="$1"
folder="$(mktemp -d)"
GLINT_PORT=$((20000 + $$ % 20000))
NATS_PORT=$((GLINT_PORT + 1))
export GLINT="$glint" GLINT_PORT NATS_PORT
"$2/local-cluster.sh" "$folder/cluster" 2 > "$folder/log" 2>&1 &
cluster=$!
trap 'kill "$cluster" 2> /dev/null || true; wait; rm -rf "$folder"' EXIT

words="--directions 42 --layers 1 --layer-tolerance 0 --estimate 0 --max-rays 256"
"$glint" scene planes --vertices 500 -o "$folder/scene.glb"
# shellcheck disable=SC2086  # words
"$glint" bake "$folder/scene.glb" -o "$folder/local.glint" --quiet $words
waited=0
until "$glint" status --to "127.0.0.1:$GLINT_PORT" > /dev/null 2>&1; do
  sleep 0.1
  waited=$((waited + 1))
  if [ "$waited" -gt 300 ]; then
    cat "$folder/log" >&2
    exit 1
  fi
done
# shellcheck disable=SC2086
"$glint" submit "$folder/scene.glb" --to "127.0.0.1:$GLINT_PORT" --wait -o "$folder/cluster.glint" $words
cmp "$folder/local.glint" "$folder/cluster.glint"

kill -TERM "$cluster"
if ! wait "$cluster" || grep -q "has ended" "$folder/log"; then
  echo "an end on demand is told as a failure" >&2
  exit 1
fi
if grep -l "$folder/cluster" /proc/[0-9]*/cmdline 2> /dev/null; then
  echo "processes are left over" >&2
  exit 1
fi
