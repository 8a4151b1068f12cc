#!/bin/sh
# Workers on the nodes of a Slurm allocation, for a coordinator and a NATS server that run elsewhere. They may be
# cancelled at any time: their tasks go to others.
# Usage: sbatch --nodes=8 deploy/slurm/workers.sh STORE NATS_URL [word of `glint worker`...]
#   GLINT  the program, the same on all nodes (default: glint)
#SBATCH --job-name=glint-worker
#SBATCH --nodes=1
#SBATCH --ntasks-per-node=1
#SBATCH --exclusive
#SBATCH --requeue
#SBATCH --time=24:00:00
#SBATCH --signal=TERM@120
set -eu
if [ $# -lt 2 ]; then
  sed -n '/^# Usage/,/^#SBATCH/p' "$0" | sed '$d; s/^# //' >&2
  exit 2
fi
store="$1" nats="$2"
shift 2
# Slurm's limit on memory is a control group, which the worker keeps to by itself.
exec "${SRUN:-srun}" --kill-on-bad-exit=0 "${GLINT:-glint}" worker --store "$store" --nats "$nats" \
  --threads "${SLURM_CPUS_ON_NODE:-0}" --log-format json "$@"
