//! Scripts that hand a sweep to an engine which exists: Slurm, xargs, GNU parallel. In: a plan's path and how many runs it has. Out: the script's
//! text. Nothing is submitted.

use super::line;

/// What runs the sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    /// A job array.
    Slurm,
    /// `xargs -P`.
    Xargs,
    /// GNU parallel.
    Parallel,
}

/// The script for `runs` runs of `plan`, at most `jobs` of them at once, to be started in `folder`.
pub fn script(engine: Engine, plan: &str, folder: &str, runs: usize, jobs: usize) -> String {
    let last = runs.saturating_sub(1);
    let plan = line(&[plan.to_owned()]);
    let folder = line(&[folder.to_owned()]);
    let alone = "#!/usr/bin/env bash\n# Every run on one core; given again, it goes on with what is not done.\nset -euo pipefail\nexport RAYON_NUM_THREADS=${RAYON_NUM_THREADS:-1}\n";
    match engine {
        Engine::Xargs => {
            format!(
                "{alone}cd {folder}\nseq 0 {last} | xargs -P {jobs} -I INDEX vibes-train sweep {plan} --index INDEX\n"
            )
        }
        Engine::Parallel => {
            format!("{alone}cd {folder}\nseq 0 {last} | parallel --jobs {jobs} vibes-train sweep {plan} --index {{}}\n")
        }
        Engine::Slurm => SLURM
            .replace("LAST", &last.to_string())
            .replace("JOBS", &jobs.to_string())
            .replace("FOLDER", &folder)
            .replace("PLAN", &plan),
    }
}

/// A run that gets the signal of the time limit saves and exits with 75; then its own element of the array is queued again, and goes on.
const SLURM: &str = r#"#!/usr/bin/env bash
#SBATCH --job-name=vibes
#SBATCH --array=0-LAST%JOBS
#SBATCH --cpus-per-task=2
#SBATCH --mem=8G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%A_%a.log
# Add your partition and account. Submit with sbatch; given again, every run goes on or says that it is done.
cd FOLDER
export RAYON_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}

# The signal comes to this shell, which hands it on and waits for the run to save.
vibes-train sweep PLAN --index slurm &
run=$!
trap 'kill -USR1 $run 2>/dev/null' USR1 TERM
while :; do
    wait $run
    code=$?
    kill -0 $run 2>/dev/null || break
done
# A signal that ended the last wait hides the run's own exit code, which the shell still knows.
wait $run 2>/dev/null
late=$?
[ $late = 127 ] || code=$late

if [ $code = 75 ]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
fi
exit $code
"#;
