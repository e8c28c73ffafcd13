//! Scripts that hand a sweep to an engine which exists: Slurm, xargs, GNU parallel. In: a plan's path and its runs. Out: the script's text. Nothing
//! is submitted.

use super::{Element, line, names_digest};

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

/// The script for the runs of `plan`, at most `jobs` of them at once, to be started in `folder`.
pub fn script(engine: Engine, plan: &str, folder: &str, elements: &[Element], jobs: usize) -> String {
    let last = elements.len().saturating_sub(1);
    // The script says numbers: of a plan that has other runs by then, they would mean others.
    let plan = format!("{} --names-are {}", line(&[plan.to_owned()]), names_digest(elements));
    let folder = line(&[folder.to_owned()]);
    let alone = "#!/usr/bin/env bash\n# Every run on one core; given again, it goes on with what is not done.\nset -euo pipefail\nexport RAYON_NUM_THREADS=${RAYON_NUM_THREADS:-1}\n";
    match engine {
        // The number comes last, so that nothing is looked for in the plan's name.
        Engine::Xargs => {
            format!("{alone}cd {folder}\nseq 0 {last} | xargs -P {jobs} -n 1 vibes-train sweep {plan} --index\n")
        }
        // GNU parallel hands what it runs to a shell once more: -q quotes it for that.
        Engine::Parallel => {
            format!(
                "{alone}cd {folder}\nseq 0 {last} | parallel -q --jobs {jobs} vibes-train sweep {plan} --index {{}}\n"
            )
        }
        Engine::Slurm => slurm(&plan, &folder, last, jobs),
    }
}

/// A run that gets the signal of the time limit saves and exits with 75; then its own element of the array is queued again, and goes on.
fn slurm(plan: &str, folder: &str, last: usize, jobs: usize) -> String {
    format!(
        r#"#!/usr/bin/env bash
#SBATCH --job-name=vibes
#SBATCH --array=0-{last}%{jobs}
#SBATCH --cpus-per-task=2
#SBATCH --mem=8G
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%A_%a.log
# Add your partition and account. Submit with sbatch; given again, every run goes on or says that it is done.
cd {folder}
export RAYON_NUM_THREADS=${{SLURM_CPUS_PER_TASK:-1}}

# The signal comes to this shell, which hands it on and waits for the run to save.
vibes-train sweep {plan} --index slurm &
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
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
fi
exit $code
"#
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elements(names: &[&str]) -> Vec<Element> {
        let element = |(index, name): (usize, &&str)| Element {
            index,
            name: (*name).to_owned(),
            folder: (*name).into(),
            settings: Default::default(),
            stages: Vec::new(),
        };
        names.iter().enumerate().map(element).collect()
    }

    /// A name of a folder or a plan is what it is, whatever words the script is made of and however a shell reads it.
    #[test]
    fn names_are_left_as_they_are() {
        let (folder, plan) = ("/data/PLAN of JOBS", "LAST INDEX/FOLDER.toml");
        let runs = elements(&["a", "b", "c"]);
        let wanted = format!("vibes-train sweep 'LAST INDEX/FOLDER.toml' --names-are {} --index", names_digest(&runs));
        for engine in [Engine::Slurm, Engine::Xargs, Engine::Parallel] {
            let text = script(engine, plan, folder, &runs, 2);
            assert!(text.contains("\ncd '/data/PLAN of JOBS'\n"), "{text}");
            assert!(text.contains(&wanted), "{text}");
        }
        assert!(script(Engine::Slurm, plan, folder, &runs, 2).contains("#SBATCH --array=0-2%2\n"));
        assert!(script(Engine::Parallel, plan, folder, &runs, 2).contains("| parallel -q --jobs 2 "));
    }

    /// Names are told apart by where they stand and where they end, and a run by everything that it does.
    #[test]
    fn other_runs_have_another_digest() {
        let plans = [&["a", "b"][..], &["b", "a"], &["ab"], &["a"], &["a", "b", "c"]];
        let digests = plans.map(|names| names_digest(&elements(names)));
        let distinct: std::collections::BTreeSet<&String> = digests.iter().collect();
        assert_eq!(distinct.len(), digests.len(), "{digests:?}");
        let run = || elements(&["a"]).remove(0);
        let longer = Element { stages: vec![vec!["vibes-train".to_owned()]], ..run() };
        let elsewhere = Element { folder: "b".into(), ..run() };
        assert_eq!(run().digest(), run().digest());
        assert!(longer.digest() != run().digest() && elsewhere.digest() != run().digest());
    }
}
