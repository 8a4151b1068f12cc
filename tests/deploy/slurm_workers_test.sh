#!/bin/sh
# The script that starts workers under Slurm, with an srun that starts the command here: the worker runs until it is told
# to end.
# Usage: slurm_workers_test.sh GLINT SLURM_FOLDER
set -eu
glint="$1" slurm="$2"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
cat > "$folder/srun" <<'SRUN'
#!/bin/sh
test "$1" = --kill-on-bad-exit=0
shift
exec "$@"
SRUN
chmod +x "$folder/srun"
# Nobody listens there: a worker waits until somebody does.
SRUN="$folder/srun" GLINT="$glint" SLURM_CPUS_ON_NODE=2 "$slurm/workers.sh" "$folder" nats://127.0.0.1:1 --memory 100 \
  2> "$folder/log" &
worker=$!
waited=0
until grep -q "worker of 2 threads" "$folder/log"; do
  sleep 0.1
  waited=$((waited + 1))
  if [ "$waited" -gt 300 ]; then
    cat "$folder/log" >&2
    exit 1
  fi
done
kill -TERM "$worker"
wait "$worker"
