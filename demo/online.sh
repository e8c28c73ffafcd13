#!/usr/bin/env bash
# Online training end to end on one machine: a random policy's returns, training from nothing in the environment, the trained policy's returns. Run by
# `make demo-online`, from the repository's root. From vector observations, so that nothing is drawn and a few minutes are enough to rise above a random policy.
# Everything it makes is kept; a second run goes on from it. DEMO_STEPS (default 40000) is the number of control steps, 1000 an episode.
set -euo pipefail
cd "$(dirname "$0")/.."

run=runs/demo-online
steps=${DEMO_STEPS:-40000}
world=(--no-pixels --distract none)

step() { printf '\n== %s\n' "$1"; }
mean() { python3 -c 'import json, sys; found = json.load(sys.stdin); print("%.1f" % found["mean_return"], "%.1f..%.1f" % tuple(found["interval"]))'; }

step "A random policy, 20 episodes"
random=$(vibes-collect --task cartpole-swingup --episodes 20 "${world[@]}" --no-mcap --json -o recordings/demo-online-random | mean)
echo "mean return and 95 % interval: $random"

step "Training from nothing for $steps control steps"
vibes-train online --task cartpole-swingup "${world[@]}" --objective reconstruction --hidden 200 --head 200 --batch 16 --rows-per-step 256 \
    --every-start 3 --control-steps "$steps" --evaluate-every 10000 -o "$run"

step "The trained policy, 20 episodes from other starts"
rm -rf recordings/demo-online-trained
trained=$(vibes-collect --policy "$run" --episodes 20 "${world[@]}" --no-mcap --seed 7 --json -o recordings/demo-online-trained | mean)
echo "mean return and 95 % interval: $trained"

step "The recording of what it lived through is one like any other"
vibes-collect verify "$run/replay"

python3 - "$random" "$trained" <<'PYTHON'
import sys
random, trained = (float(text.split()[0]) for text in sys.argv[1:])
print(f"\ntrained {trained} against random {random}")
sys.exit(0 if trained > random else "the trained policy is not above the random one: give it more steps (DEMO_STEPS)")
PYTHON
