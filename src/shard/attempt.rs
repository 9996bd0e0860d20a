//! An attempt at a shard: one process, and a folder to which only this process writes. Attempts therefore
//! need no locks on the files in their folders (but they take device locks). A first attempt that is still
//! running cannot damage the files of a second attempt.

use super::Shard;
use crate::device::variables;
use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::{MOVED_SAMPLES, keeps_moved_samples};
use crate::record::{Host, cannot_make, write_whole};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The name of the folder that contains the folders of all attempts.
const PARTS: &str = "parts";
/// The name of the file that describes an attempt, in the attempt's folder.
const ABOUT: &str = "attempt.json";
/// The name of the file that says how an attempt ended, in the attempt's folder.
const END: &str = "end.json";

/// The description of an attempt (one process that measures a shard).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// The shard's number, from 1.
    pub shard: u32,
    /// The number of shards into which the experiment is divided.
    pub of: u32,
    /// The name of the machine on which the attempt runs.
    pub host: String,
    /// The job's number in the scheduler; "0" if no scheduler sets one.
    pub job: String,
    /// The number that the scheduler gives to this start of the job (Slurm counts from 0, GitHub from 1); 0 if no
    /// scheduler sets the number. If another attempt at the same shard, on the same machine and in the same job, has
    /// this number already, `restart` is the next free number.
    pub restart: u32,
    /// The ID of the attempt's process on its machine.
    pub process: u32,
    /// The time limit for one step of the measurement, in seconds.
    pub hang_limit_s: f64,
    /// The kinds of device that the attempt measures on. Each kind is given by the text `Kind::identity`: the
    /// platform, the device, the driver, and every property of the device that affects times.
    pub devices: Vec<String>,
    /// The command line, starting with the program.
    pub command: Vec<String>,
    /// The folder in which the command was started; null if the folder's path is not known or not UTF-8, and
    /// in files of earlier versions.
    pub folder: Option<String>,
    /// The word in the variable `RAYCL_DEVICE` or in the user's settings that selected the devices. Null if
    /// neither the variable nor the settings selected the devices: the command or the config names the
    /// devices, or the variable and the settings name none. The field `device` is also null in files that
    /// earlier versions of raycl wrote.
    pub device: Option<String>,
    /// The environment variables that the user had set and that a repetition of the command needs, each as
    /// `NAME=VALUE`; missing in files of earlier versions.
    #[serde(default)]
    pub variables: Vec<String>,
    /// The hash of the blocks of the plan that the attempt used; null in files of earlier versions.
    pub plan: Option<String>,
}

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// All points of the attempt have records.
    Done,
    /// The user, or a signal of the scheduler, ended the attempt.
    Interrupted,
    /// The attempt's launcher (the program that started the attempt, such as `mpirun`) or a process between the
    /// launcher and the attempt has ended. `LauncherLost` contains a text with the name of the process that has ended.
    LauncherLost(String),
    /// The attempt failed with this error.
    Failed(String),
}

/// The folder of an attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attempt {
    /// The folder's path.
    pub folder: PathBuf,
    /// The attempt's name, which consists of the shard, the machine, the job and the restart.
    pub name: String,
}

impl About {
    /// Describes this process. The machine, the job and the restart come from the scheduler's environment
    /// variables, if these variables are set.
    pub fn of_this_process(shard: Shard, devices: Vec<String>, hang_limit_s: f64) -> Self {
        let own = Self {
            shard: shard.number,
            of: shard.of,
            process: std::process::id(),
            hang_limit_s,
            devices,
            command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
            folder: std::env::current_dir().ok().and_then(|folder| folder.to_str().map(str::to_owned)),
            variables: repeated_variables(keeps_moved_samples()),
            ..Self::default()
        };
        own.started_by(&|name| std::env::var(name).ok(), Host::read().name)
    }

    /// Adds the machine, the job and the restart, from the environment variables of the scheduler and from the
    /// machine's own name. If the machine's name is unknown, the machine is called "machine"; an unknown job is "0",
    /// and an unknown restart is 0.
    fn started_by(self, variable: &dyn Fn(&str) -> Option<String>, machine: Option<String>) -> Self {
        let set = |name: &&str| variable(name).filter(|text| !text.is_empty());
        let first = |names: &[&str]| names.iter().find_map(set);
        // Several of Slurm's virtual nodes may run on one machine, so the node's name is used, and not the machine's
        // name. For Kubernetes, no variable is read: inside a pod, the machine's name is the pod's name.
        let host = first(&["SLURMD_NODENAME"]).or(machine);
        let restart = first(&["SLURM_RESTART_COUNT", "GITHUB_RUN_ATTEMPT"]);
        Self {
            host: host.unwrap_or_else(|| "machine".to_owned()),
            job: first(&["SLURM_JOB_ID", "CI_JOB_ID", "GITHUB_RUN_ID", "HQ_JOB_ID"])
                .unwrap_or_else(|| "0".to_owned()),
            restart: restart.and_then(|count| count.parse().ok()).unwrap_or(0),
            ..self
        }
    }
}

impl Attempt {
    /// Makes the folder of a new attempt, and writes the attempt's description into the folder. If a folder for the
    /// attempt's restart number exists, the attempt gets the next free restart number.
    pub fn begin(out: &Path, about: &About) -> Result<Self> {
        let parts = out.join(PARTS);
        let failed = |path: &Path, error: std::io::Error| {
            cannot_make(path, &error, "choose another folder with --out DIR, to which all machines can write")
        };
        std::fs::create_dir_all(&parts).map_err(|error| failed(&parts, error))?;
        let mut about = about.clone();
        loop {
            let name = name(&about);
            let folder = parts.join(&name);
            // Making a folder fails if the folder exists. If two processes try to make the same folder at once, on any
            // machines, only one succeeds.
            match std::fs::create_dir(&folder) {
                Ok(()) => {
                    let attempt = Self { folder, name };
                    attempt.write(ABOUT, &about)?;
                    return Ok(attempt);
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => about.restart += 1,
                Err(error) => return Err(failed(&folder, error)),
            }
        }
    }

    /// Returns all attempts in a folder, sorted by name. Fails if an attempt may exist, but cannot be found: a merge
    /// without this attempt would lose its results.
    pub fn all(out: &Path) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for folder in existing::entries(&out.join(PARTS))? {
            if existing::is_folder(&folder)? {
                let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
                all.push(Self { folder, name });
            }
        }
        all.sort_by(|one, other| one.name.cmp(&other.name));
        Ok(all)
    }

    /// Returns the folders of other attempts at the same shard. Fails in the same cases as
    /// [`all`](Self::all).
    pub fn earlier(&self, out: &Path) -> Result<Vec<PathBuf>> {
        let shard = |name: &str| name.split('.').next().map(str::to_owned);
        let same = |other: &Self| other.name != self.name && shard(&other.name) == shard(&self.name);
        Ok(Self::all(out)?.into_iter().filter(same).map(|other| other.folder).collect())
    }

    /// Returns the attempt's description; `None` if the attempt was killed before it wrote the description,
    /// or if the description is not valid JSON. If the system cannot read the description, returns an error
    /// and not `None`, since the description may exist.
    pub fn about(&self) -> Result<Option<About>> {
        self.read(ABOUT)
    }

    /// Returns how the attempt ended; `None` if the attempt is still running or was killed, or if the file
    /// that says how it ended is not valid JSON. If the system cannot read this file, returns an error and
    /// not `None`, since the file may exist.
    pub fn end(&self) -> Result<Option<End>> {
        self.read(END)
    }

    /// Writes into the attempt's folder how the attempt ended.
    pub fn ended(&self, end: &End) -> Result<()> {
        self.write(END, end)
    }

    fn read<T: serde::de::DeserializeOwned>(&self, file: &str) -> Result<Option<T>> {
        let text = existing::bytes(&self.folder.join(file))?;
        Ok(text.and_then(|text| serde_json::from_slice(&text).ok()))
    }

    fn write(&self, file: &str, what: &impl Serialize) -> Result<()> {
        let text = serde_json::to_vec(what).map_err(|error| Error::fault(error.to_string()))?;
        write_whole(&self.folder.join(file), &text)
    }
}

/// Returns the variables that a repetition of the command needs, each as `NAME=VALUE`: `RAYCL_MOVED_SAMPLES`, if
/// `keeps_moved_samples` is true, and the variables of drivers that the user had set.
fn repeated_variables(keeps_moved_samples: bool) -> Vec<String> {
    let own = keeps_moved_samples.then(|| format!("{MOVED_SAMPLES}=keep"));
    own.into_iter().chain(variables::of_user().iter().cloned()).collect()
}

/// Returns the name of an attempt, such as "shard-00003.node7.4711.r00". Each character of the machine's name and of
/// the job's number that is neither an ASCII letter nor a digit becomes `-`. Sorting the names sorts the shards by
/// their numbers, up to shard 99999.
fn name(about: &About) -> String {
    let plain = |text: &str| {
        text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect::<String>()
    };
    format!("shard-{:05}.{}.{}.r{:02}", about.shard, plain(&about.host), plain(&about.job), about.restart)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about(shard: u32, host: &str) -> About {
        About { shard, of: 16, host: host.into(), job: "47_1".into(), ..About::default() }
    }

    #[test]
    fn each_attempt_has_a_folder_of_its_own_and_knows_the_others_of_its_shard() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let one = Attempt::begin(out, &about(3, "n.1")).unwrap();
        let again = Attempt::begin(out, &about(3, "n.1")).unwrap();
        let other = Attempt::begin(out, &about(12, "n2")).unwrap();
        assert_eq!([&one.name, &again.name], ["shard-00003.n-1.47-1.r00", "shard-00003.n-1.47-1.r01"]);
        assert_eq!(Attempt::all(out).unwrap(), [one.clone(), again.clone(), other.clone()]);
        let [of_again, of_other] = [&again, &other].map(|attempt| attempt.earlier(out).unwrap());
        assert_eq!((of_again, of_other), (vec![one.folder.clone()], vec![]));
        assert_eq!(again.about().unwrap().map(|about| (about.shard, about.restart)), Some((3, 1)));
        assert_eq!(one.end().unwrap(), None);
        one.ended(&End::LauncherLost("slurmstepd".into())).unwrap();
        assert_eq!(one.end().unwrap(), Some(End::LauncherLost("slurmstepd".into())));
    }

    /// In this test, a link that leads to itself stands for any file or folder that cannot be read, for
    /// example because of its permissions or a failed disk.
    #[cfg(unix)]
    #[test]
    fn what_cannot_be_read_does_not_count_as_missing() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        assert!(Attempt::all(out).unwrap().is_empty(), "no attempt has begun");
        let attempt = Attempt::begin(out, &about(3, "n1")).unwrap();
        let [end, other] = [attempt.folder.join(END), out.join(PARTS).join("shard-00003.n2.0.r00")];
        symlink(&end, &end).unwrap();
        assert!(attempt.end().unwrap_err().to_string().contains(&end.display().to_string()));
        assert!(attempt.about().is_ok());
        symlink(&other, &other).unwrap();
        for error in [Attempt::all(out).unwrap_err(), attempt.earlier(out).unwrap_err()] {
            assert!(error.to_string().contains(&other.display().to_string()), "{error}");
        }
        let unlisted = out.join("unlisted");
        std::fs::create_dir(&unlisted).unwrap();
        symlink(unlisted.join(PARTS), unlisted.join(PARTS)).unwrap();
        assert!(Attempt::all(&unlisted).is_err());
    }

    #[test]
    fn of_attempts_that_begin_at_once_none_shares_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let names: Vec<String> = std::thread::scope(|scope| {
            let begin = |_| scope.spawn(|| Attempt::begin(folder.path(), &about(1, "n1")).unwrap().name);
            let threads: Vec<_> = (0..8).map(begin).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        let distinct: std::collections::HashSet<_> = names.iter().collect();
        assert_eq!(distinct.len(), 8);
    }

    #[test]
    fn an_attempt_names_the_job_that_its_scheduler_started() {
        let job_of = |variables: &str, machine: Option<&str>| {
            let variable = |name: &str| {
                variables
                    .split(' ')
                    .find_map(|one| one.strip_prefix(name)?.strip_prefix('=').map(str::to_owned))
            };
            let about = About { shard: 3, of: 16, ..About::default() };
            let About { shard, of, host, job, restart, .. } =
                about.started_by(&variable, machine.map(str::to_owned));
            assert_eq!((shard, of), (3, 16));
            format!("{host} {job} {restart}")
        };
        for (variables, machine, expected) in [
            ("SLURMD_NODENAME=node7 SLURM_JOB_ID=4711 SLURM_RESTART_COUNT=2", Some("m"), "node7 4711 2"),
            ("GITHUB_RUN_ID=99 GITHUB_RUN_ATTEMPT=3", Some("m"), "m 99 3"),
            ("CI_JOB_ID=55", Some("m"), "m 55 0"),
            ("HQ_JOB_ID=8", Some("m"), "m 8 0"),
            ("SLURM_JOB_ID=1 CI_JOB_ID=2", Some("m"), "m 1 0"),
            ("SLURMD_NODENAME= SLURM_JOB_ID= CI_JOB_ID=2 SLURM_RESTART_COUNT=x", Some("m"), "m 2 0"),
            ("", None, "machine 0 0"),
        ] {
            assert_eq!(job_of(variables, machine), expected, "{variables}");
        }
    }

    #[test]
    fn an_attempt_of_an_earlier_version_has_no_variables() {
        let folder = tempfile::tempdir().unwrap();
        let attempt = Attempt::begin(folder.path(), &about(3, "n1")).unwrap();
        let file = attempt.folder.join(ABOUT);
        let text = std::fs::read_to_string(&file).unwrap();
        let earlier = text.replace("\"variables\":[],", "");
        assert_ne!(earlier, text);
        std::fs::write(&file, earlier).unwrap();
        assert_eq!(attempt.about().unwrap(), Some(about(3, "n1")));
    }

    #[test]
    fn this_process_describes_itself() {
        let shard = Shard { number: 3, of: 16 };
        let about = About::of_this_process(shard, vec!["a gpu".into()], 12.5);
        assert_eq!((about.shard, about.of, about.process), (3, 16, std::process::id()));
        assert_eq!((about.devices, about.hang_limit_s), (vec!["a gpu".to_owned()], 12.5));
        assert!(!about.host.is_empty() && !about.command[0].is_empty());
        assert_eq!(about.folder.map(PathBuf::from), std::env::current_dir().ok());
        let of_drivers = variables::of_user();
        assert_eq!(repeated_variables(false), of_drivers);
        assert_eq!(
            repeated_variables(true),
            [&["RAYCL_MOVED_SAMPLES=keep".to_owned()][..], of_drivers].concat()
        );
    }
}
