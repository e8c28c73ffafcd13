"""A search by Optuna: it proposes options, a short run is trained with them, and the share of the latents' variance that the state explains on a
held-out grid is the answer.

    python optuna_search.py RECORDING GRID [--trials 20] [--updates 2000] [-o runs/search]

Ask and tell: Optuna never calls us. The trials lie in runs/search/study.db, so that several processes can search together and the same command goes on.
Needs optuna, as tests/sweep_engines.txt names it.
"""

import argparse
import json
import subprocess
from pathlib import Path

import optuna


def score(words, run, recording, grid):
    """Trains with the options and evaluates: the state's share of the latents' variance."""
    subprocess.run(["vibes-train", "offline", recording, *words, "--quiet", "-o", run], check=True)
    said = subprocess.run(["vibes-train", "evaluate", run, grid, "--gap-updates", "0", "--json"], check=True, capture_output=True)
    return json.loads(said.stdout)["report"]["numbers"]["state_share"]["estimate"]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("recording")
    arguments.add_argument("grid")
    arguments.add_argument("--trials", type=int, default=20)
    arguments.add_argument("--updates", type=int, default=2000)
    arguments.add_argument("--preset", default="small")
    arguments.add_argument("-o", "--output", type=Path, default=Path("runs/search"))
    asked = arguments.parse_args()
    asked.output.mkdir(parents=True, exist_ok=True)
    study = optuna.create_study(
        study_name="vibes", storage=f"sqlite:///{asked.output / 'study.db'}", load_if_exists=True, direction="maximize"
    )
    while len(study.get_trials(states=[optuna.trial.TrialState.COMPLETE])) < asked.trials:
        trial = study.ask()
        words = ["--preset", asked.preset, "--updates", asked.updates]
        words += ["--lr", trial.suggest_float("lr", 1e-4, 1e-3, log=True)]
        words += ["--dynamics-weight", trial.suggest_float("dynamics_weight", 0.01, 1.0, log=True)]
        words = [str(word) for word in words]
        try:
            value = score(words, asked.output / f"trial-{trial.number:03}", asked.recording, asked.grid)
        except subprocess.CalledProcessError:
            study.tell(trial, state=optuna.trial.TrialState.FAIL)
            raise
        study.tell(trial, value)
        print(f"trial {trial.number}: {value:.3f} with {trial.params}", flush=True)
    print(f"best: {study.best_value:.3f} with {study.best_params}")


if __name__ == "__main__":
    main()
