#!/usr/bin/env bash
# The main job end to end on one machine: record, train, encode, analyse. Run by `make demo`, from the repository's root.
# Everything it makes is kept; a second run reuses it and says so. DEMO_MINUTES (default 9) is the time spent training.
set -euo pipefail
cd "$(dirname "$0")/.."

train=recordings/demo-train # reacher-easy, mixed behaviour, training videos
grid=recordings/demo-grid   # 8 state trajectories under 8 distractor trajectories, held-out videos
run=runs/demo
minutes=${DEMO_MINUTES:-9}
started=$SECONDS

step() { printf '\n== %s\n' "$1"; }

step "Recording training episodes: random, noisy and good behaviour, training videos"
vibes-collect --task reacher-easy --episodes 120 --mix random:0.2,planner:noise=0.5:0.4,planner:0.4 \
    --video-set train --video-count 60 --seed 1 -o "$train"

step "Recording a grid on held-out videos"
vibes-collect --task reacher-easy --grid 8x8 --policy planner:noise=0.2 \
    --video-set val --video-count 8 --seed 2 -o "$grid"

step "Training VIBES for $minutes minutes"
vibes-train offline "$train" --minutes "$minutes" --seed 0 -o "$run"

step "Encoding the grid"
vibes-train encode "$run" "$grid"

updates=$(vibes-train info "$run" --json | python3 -c 'import json, sys; print(json.load(sys.stdin)["last"]["update"])')
note="trained for $updates updates in $minutes minutes : barely trained"
latents=$run/latents.arrow

step "Analysing"
vibes-analyze nn --queries 6 --latents "$latents" --note "$note"
vibes-analyze umap --latents "$latents" --note "$note"
vibes-analyze grid --panels 4x4 --latents "$latents" --note "$note"
vibes-analyze invariance --latents "$latents" --note "$note"
vibes-analyze probe --latents "$latents" --note "$note"
vibes-analyze scene --latents "$latents"

figures=$run/figures
cat <<EOF

Done in $(((SECONDS - started) / 60)) min $(((SECONDS - started) % 60)) s. $updates updates are far from a converged model: read the figures as such.

  $figures/neighbours.png    query frames above their five nearest neighbours from other trajectories: do they show the same arm and target?
  $figures/map-by-state.png  every latent on one UMAP map, coloured by state trajectory (also by time, reward, distractor)
  $figures/grid.png          rows share the state, columns the distractor: a row should look alike from left to right
  $figures/invariance.png    how much of the latents' variance is state, how much distractor; how often a neighbour shows the same state
  $figures/probes.png        what can be read off the latents: task quantities should be high, distractor parameters at chance
  $figures/scene.rrd         frame, latent, map and neighbours on one timeline; open it with: rerun $figures/scene.rrd

Train on with: vibes-train offline $train --updates 50000 -o $run
EOF
