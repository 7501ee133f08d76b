#!/usr/bin/env bash
# Train what textures need, and what their tables compare it with: two lanes at once, one core each, 140 minutes.
#   docs/train_textures.sh DATA RUNS
# Run again after an interruption: what is done is done, what was cut off goes on.
set -euo pipefail
DATA=$1 RUNS=$2
export OMP_NUM_THREADS=1
TRAIN="${FIG2MESH:-.venv/bin/fig2mesh} train"
mkdir -p "$RUNS"

first() {
  $TRAIN uv --data "$DATA" --budget 40 -o "$RUNS/uv-masks"
  $TRAIN uv --data "$DATA" --init "$RUNS/uv-masks" --lr 1.5e-3 --budget 75 -o "$RUNS/uv-masks-more"
  $TRAIN uv --data "$DATA" --no-masks --budget 25 -o "$RUNS/uv-depth"
}

second() {
  $TRAIN fill --data "$DATA" --budget 25 -o "$RUNS/fill"
  $TRAIN refine --data "$DATA" --fill "$RUNS/fill" --budget 25 -o "$RUNS/refine"
  $TRAIN head --data "$DATA" --fill "$RUNS/fill" --budget 12 -o "$RUNS/head"
}

first > "$RUNS/textures-first.log" 2>&1 &
second > "$RUNS/textures-second.log" 2>&1 &
wait -n && wait -n
