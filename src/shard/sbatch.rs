//! Makes a shell script. The shell script contains two Slurm scripts, one for the shards and one for the merge, and
//! submits both to Slurm. raycl prints the shell script, but does not run it.

use crate::words::{counted, quote};
use std::fmt::Write as _;
use std::time::Duration;

/// The inputs from which the Slurm scripts are made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// The experiment's name.
    pub name: String,
    /// Number of shards.
    pub shards: u32,
    /// The command of a shard without its number: the program, "run", the config, options.
    pub command: Vec<String>,
    /// The folder of results, to which all shards write.
    pub out: String,
    /// True if a shard needs a GPU, false if it needs processors; `None` if this is unknown.
    pub on_gpu: Option<bool>,
    /// The expected time of the longest shard.
    pub longest: Duration,
    /// True if every point was measured in an earlier run. If false, the expected time is a guess.
    pub is_known: bool,
}

/// If the longest shard takes at least the time `WORTH_AN_ELEMENT`, or if its time is a guess, the shards
/// become elements of a job array. Slurm starts the elements of an array one after another, and takes a few
/// seconds for each element. Slurm can requeue a single element. If the longest shard is known to take less
/// time than `WORTH_AN_ELEMENT`, the shards become tasks of one job step. All tasks of the step start at the
/// same time.
const WORTH_AN_ELEMENT: Duration = Duration::from_secs(120);

/// Returns a shell script that submits the scripts of the shards and of the merge. The command `sbatch` reads
/// these scripts from its standard input. The shell script therefore writes no file, and cannot replace one
/// of the user's files. The merge is submitted only if the shards were submitted.
pub fn scripts(wishes: &Wishes) -> String {
    let command = wishes.command.iter().map(|word| quote(word)).collect::<Vec<_>>().join(" ");
    let (n, name, out) = (wishes.shards, plain(&wishes.name), quote(&wishes.out));
    let is_array = wishes.longest >= WORTH_AN_ELEMENT || !wishes.is_known;
    let how = match wishes.is_known {
        true => "based on earlier times",
        false => "a guess: not all points were measured before",
    };
    let seconds = wishes.longest.as_secs_f64().ceil() as u64;
    let shards = counted(n as usize, "shard");
    let mut text = format!(
        "# {shards}; the longest takes about {seconds} s ({how}). The time limit is twice this time plus ten minutes.\n\
         job=$(sbatch --parsable <<'END'\n#!/bin/bash\n#SBATCH --job-name={name}\n"
    );
    let tasks = if is_array {
        format!("--array=1-{n}\n#SBATCH --ntasks=1")
    } else {
        format!("--ntasks={n}\n#SBATCH --ntasks-per-node=1")
    };
    let minutes = (2 * seconds).div_ceil(60) + 10;
    let run = match is_array {
        true => format!("exec {command} --shard auto/{n}"),
        // If one task of the job step is lost, the tasks of the other shards must continue.
        false => format!("exec srun --kill-on-bad-exit=0 {command} --shard auto"),
    };
    // Writing to a String cannot fail, so the results are ignored.
    let _ = write!(
        text,
        "#SBATCH {tasks}\n{}#SBATCH --time={minutes}\n#SBATCH --requeue\n#SBATCH --open-mode=append\n{run}\nEND\n",
        devices(wishes.on_gpu)
    );
    let _ = write!(
        text,
        ") && sbatch --dependency=afterany:${{job%%;*}} <<'END'\n#!/bin/bash\n#SBATCH --job-name={name}-merge\n\
         #SBATCH --ntasks=1\n#SBATCH --time=30\nexec raycl merge {out}\nEND\n"
    );
    text
}

fn devices(on_gpu: Option<bool>) -> &'static str {
    match on_gpu {
        Some(true) => "#SBATCH --gres=gpu:1\n",
        Some(false) => "#SBATCH --exclusive\n",
        None => "#SBATCH --exclusive\n# for GPUs, instead of the line above: #SBATCH --gres=gpu:1\n",
    }
}

/// Returns a name for a Slurm job that contains only letters, digits and the characters `-` and `_`.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wishes(seconds: u64, is_known: bool) -> Wishes {
        Wishes {
            name: "figure 6".into(),
            shards: 16,
            command: ["raycl", "run", "a b.toml", "--out", "o"].map(str::to_owned).to_vec(),
            out: "o".into(),
            on_gpu: Some(true),
            longest: Duration::from_secs(seconds),
            is_known,
        }
    }

    #[test]
    fn long_shards_are_an_array_and_short_ones_a_step() {
        let long = scripts(&wishes(900, true));
        for line in [
            "#SBATCH --array=1-16",
            "#SBATCH --time=40",
            "#SBATCH --gres=gpu:1",
            "#SBATCH --requeue",
            "exec raycl run 'a b.toml' --out o --shard auto/16",
        ] {
            assert!(long.lines().any(|own| own == line), "{line}\n{long}");
        }
        let short = scripts(&wishes(20, true));
        assert!(
            short.contains("#SBATCH --ntasks=16")
                && short.contains("exec srun --kill-on-bad-exit=0 raycl run"),
            "{short}"
        );
        assert!(short.contains("\nEND\n) && sbatch --dependency=afterany:${job%%;*} <<'END'\n"), "{short}");
        assert!(scripts(&wishes(1, false)).contains("--array"), "a shard of unknown duration may take long");
        assert!(
            scripts(&Wishes { on_gpu: Some(false), ..wishes(1, true) }).contains("#SBATCH --exclusive\n")
        );
    }

    #[test]
    fn a_jobs_name_is_one_word() {
        assert_eq!(plain("figure 6/b_2-c.toml"), "figure-6-b_2-c-toml");
    }

    #[test]
    fn a_script_has_the_limits_and_the_commands_that_its_comment_states() {
        let has = |text: &str, lines: &[&str]| {
            for line in lines {
                assert!(text.lines().any(|own| own == *line), "{line}\n{text}");
            }
        };
        let short = scripts(&wishes(20, true));
        has(
            &short,
            &[
                "# 16 shards; the longest takes about 20 s (based on earlier times). The time limit is twice this time \
                 plus ten minutes.",
                "#SBATCH --job-name=figure-6",
                "#SBATCH --ntasks-per-node=1",
                "#SBATCH --time=11",
                "exec srun --kill-on-bad-exit=0 raycl run 'a b.toml' --out o --shard auto",
                "#SBATCH --job-name=figure-6-merge",
                "exec raycl merge o",
            ],
        );
        let unknown = scripts(&Wishes { on_gpu: None, out: "a b".into(), ..wishes(20, false) });
        has(
            &unknown,
            &[
                "#SBATCH --array=1-16",
                "#SBATCH --ntasks=1",
                "#SBATCH --exclusive",
                "# for GPUs, instead of the line above: #SBATCH --gres=gpu:1",
                "exec raycl merge 'a b'",
            ],
        );
        assert!(unknown.contains("(a guess: not all points were measured before)"), "{unknown}");
        let short = Wishes { shards: 1, longest: Duration::from_millis(300), ..wishes(1, true) };
        let first = "# 1 shard; the longest takes about 1 s (based on earlier times).";
        assert!(scripts(&short).starts_with(first), "{}", scripts(&short));
        let is_array = |seconds| scripts(&wishes(seconds, true)).contains("--array");
        assert_eq!([is_array(119), is_array(120)], [false, true]);
    }
}
