#!/usr/bin/env bash
# The main job end to end on one machine: record, train, encode, analyse. Run by `make demo`, from the repository's root.
# Everything it makes is kept; a second run reuses it and says so. DEMO_MINUTES (default 8) is the time spent training.
set -euo pipefail
cd "$(dirname "$0")/.."

train=recordings/demo-train # cartpole-swingup, mixed behaviour, training videos
again=recordings/demo-again # the same states under other distractors
grid=recordings/demo-grid   # 8 state trajectories under 8 distractor trajectories, held-out videos
run=runs/demo
kept=checkpoints/cartpole-swingup
minutes=${DEMO_MINUTES:-8}
started=$SECONDS

step() { printf '\n== %s\n' "$1"; }

step "Recording training episodes: random, noisy and good behaviour, training videos"
vibes-collect --task cartpole-swingup --episodes 80 --mix random:0.2,planner:noise=1:0.4,planner:noise=0.4:0.4 \
    --video-set train --video-count 90 --seed 1 -o "$train"

step "Drawing the same episodes under other distractors as well"
for view in 1 2; do
    vibes-collect render "$train" --seed "10$view" --video-set train --video-count 90 --no-mcap -o "$again-$view"
done

step "Recording a grid on held-out videos"
vibes-collect --task cartpole-swingup --grid 8x8 --mix random:0.2,planner:noise=1:0.4,planner:noise=0.4:0.4 \
    --video-set val --video-count 8 --seed 2 -o "$grid"

step "Training VIBES for $minutes minutes"
vibes-train offline "$train" "$again-1" "$again-2" --minutes "$minutes" --seed 0 -o "$run"

step "Encoding the grid, with this model and with the kept one, which learned from other recordings"
vibes-train encode "$run" "$grid"
vibes-train encode "$kept" "$grid" -o "$run-kept/latents.arrow"

step "Encoding what was trained on, for probes to be fitted on"
fits=()
for recording in "$train" "$again-1" "$again-2"; do
    table=$run/fit-$(basename "$recording").arrow
    vibes-train encode "$run" "$recording" -o "$table"
    fits+=(--fit "$table")
done

step "How far it got"
vibes-train evaluate "$run" "$grid" --gap-updates 0
# Updates and minutes of the newest checkpoint, over every time that training went on, and the verdict: is most of what varies the state?
note=$(python3 - "$run" <<'PY'
import json, pathlib, sys

run = pathlib.Path(sys.argv[1])
newest = max((run / "checkpoints").glob("*/state.json"), key=lambda path: int(path.parent.name))
trained = json.loads(newest.read_text())
state = json.loads((run / "evaluation.json").read_text())["report"]["numbers"]["state_share"]["estimate"]
minutes = f"{trained['seconds'] / 60:.1f}".removesuffix(".0")
verdict = "it follows cart and pole; on which side the pole is comes later" if state >= 0.8 else "barely trained"
print(f"{trained['update']} updates from nothing in {minutes} minutes: {verdict}")
PY
)
latents=$run/latents.arrow

step "Analysing"
vibes-analyze nn --queries 6 --latents "$latents" --note "$note"
vibes-analyze umap --latents "$latents" --note "$note"
vibes-analyze grid --panels 4x4 --latents "$latents" --note "$note"
vibes-analyze invariance --latents "$latents" --note "$note"
vibes-analyze probe --latents "$latents" "${fits[@]}" --note "$note"
vibes-analyze compare "$latents" "$run-kept/latents.arrow"
vibes-analyze scene --latents "$latents"

figures=$run/figures
cat <<EOF

Done in $(((SECONDS - started) / 60)) min $(((SECONDS - started) % 60)) s. After $note.

  $figures/neighbours.png    query frames above their five nearest neighbours from other trajectories: do their poles stand alike?
  $figures/map-by-state.png  every latent on one UMAP map, coloured by state trajectory (also by time, reward, distractor)
  $figures/grid.png          rows share the state, columns the distractor: a row should look alike from left to right
  $figures/invariance.png    how much of the latents' variance is state, how much distractor; how often a neighbour shows the same state
  $figures/probes.png        what can be read off the latents: task quantities should be high, distractor parameters at chance;
                             probes.json has the same numbers as $run/evaluation.json, under the same names
  $figures/compare.png       this model beside the kept one
  $figures/scene.rrd         frame, latent, map and neighbours on one timeline; open it with: rerun $figures/scene.rrd

Train on with: vibes-train offline $train $again-1 $again-2 --minutes 0 --updates 50000 -o $run
Or go on from the kept weights: vibes-train offline $train $again-1 $again-2 --from $kept -o runs/further
EOF
