#!/bin/sh
# A cluster on this machine, until Ctrl-C: NATS, `glint serve`, and workers, all on loopback.
# Usage: deploy/local-cluster.sh [FOLDER [WORKERS]]   FOLDER for all that it keeps; default: out/cluster, one worker a core
# GLINT names the program (default: build/release/tools/glint); ports: GLINT_PORT (7117), NATS_PORT (4222).
set -eu
from="$PWD"
cd "$(dirname "$0")/.."
# The user's names are meant from where the user is.
absolute() { (cd "$from" && realpath -m -- "$1"); }
folder="${1:+$(absolute "$1")}"
folder="${folder:-out/cluster}"
workers="${2:-$(nproc)}"
glint="${GLINT:+$(absolute "$GLINT")}"
glint="${glint:-build/release/tools/glint}"
port="${GLINT_PORT:-7117}"
nats_port="${NATS_PORT:-4222}"
export GLINT_NATS="nats://127.0.0.1:$nats_port"

nats="$(command -v nats-server || echo /usr/sbin/nats-server)"
for program in "$glint" "$nats"; do
  if [ ! -x "$program" ]; then
    echo "$program is not there; run deploy/quickstart.sh first" >&2
    exit 2
  fi
done
mkdir -p "$folder/store"
cat > "$folder/nats.conf" <<CONF
listen: 127.0.0.1:$nats_port
jetstream { store_dir: "$folder/nats", max_memory_store: 64M, max_file_store: 1G }
CONF

# In order: workers finish their tasks while the queue still answers.
pids=""
stop() {
  trap - INT TERM EXIT
  for pid in $pids; do
    kill "$pid" 2>/dev/null || true
    wait "$pid" 2>/dev/null || true
  done
  kill "$nats_pid" 2>/dev/null || true
  wait
}
trap stop EXIT
trap 'stop; exit 0' INT TERM

"$nats" -c "$folder/nats.conf" > "$folder/nats.log" 2>&1 &
nats_pid=$!
# Half the memory, the machine's or the container's, for what workers keep between layers.
memory=$({
  awk '/^MemTotal/ { printf "%.0f\n", $2 * 1024 }' /proc/meminfo
  cat /sys/fs/cgroup/memory.max /sys/fs/cgroup/memory/memory.limit_in_bytes 2> /dev/null || true
} | awk -v n="$workers" '/^[0-9]+$/ && (!least || $1 < least) { least = $1 } END { printf "%d", least / 1048576 / 2 / n + 1 }')
i=0
while [ "$i" -lt "$workers" ]; do
  "$glint" worker --store "$folder/store" --threads 1 --memory "$memory" > "$folder/worker-$i.log" 2>&1 &
  pids="$pids $!"
  i=$((i + 1))
done
"$glint" serve --store "$folder/store" --listen "127.0.0.1:$port" --workers &
serve_pid=$!
pids="$pids $serve_pid"

echo "$workers workers; logs in $folder. Try: $glint submit SCENE.glb --to 127.0.0.1:$port --wait -o OUT.glint"
wait "$serve_pid" || { echo "the service has ended; so does all of it" >&2; exit 1; }
