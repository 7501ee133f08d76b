#!/usr/bin/env bash
# Train everything that ships, and what tables 1 and 2 need besides: two lanes at once, one core each, some three hours.
#   docs/train_shipped.sh PACK DATA RUNS
# Run again after an interruption: what is done is done, what was cut off goes on.
set -euo pipefail
PACK=$1 DATA=$2 RUNS=$3
export OMP_NUM_THREADS=1
TRAIN="${FIG2MESH:-.venv/bin/fig2mesh} train"
mkdir -p "$RUNS/begun"

first() {
  $TRAIN size --data "$DATA" --budget 0.4 -o "$RUNS"
  begin upper_arm upper_leg lower_leg foot
  for seed in 1 2 3; do
    for variant in one-stream one-stream-pose two-stream two-stream-pose; do
      $TRAIN parts --data "$DATA" --kind hand --variant "$variant" --budget 1 --seed $seed -o "$RUNS/table2/$seed"
    done
  done
  finish upper_arm upper_leg lower_leg foot
  again upper_arm
}

second() {
  begin hand
  $TRAIN pose --data "$PACK" --visibility --budget 60 -o "$RUNS/pose-21"
  begin torso head lower_arm
  for joints in 21 16; do
    for view in "" --perspective; do
      $TRAIN pose --data "$PACK" --joints $joints --metric --plain $view --budget 2.5 -o "$RUNS/table1/$joints$view"
    done
  done
  finish hand torso head lower_arm
  again hand torso head
}

begin() {
  for kind in "$@"; do
    $TRAIN parts --data "$DATA" --kind "$kind" --budget 9 -o "$RUNS/begun"
  done
}

# A second round from where the first ended, at half the rate.
finish() {
  for kind in "$@"; do
    $TRAIN parts --data "$DATA" --kind "$kind" --budget 8 --lr 1e-3 --init "$RUNS/begun" -o "$RUNS"
  done
}

# A third round for the parts that gain most by it; its weights are those that ship.
again() {
  for kind in "$@"; do
    $TRAIN parts --data "$DATA" --kind "$kind" --budget 8 --lr 1e-3 --init "$RUNS" -o "$RUNS/third"
  done
}

first > "$RUNS/first.log" 2>&1 &
second > "$RUNS/second.log" 2>&1 &
wait -n && wait -n
