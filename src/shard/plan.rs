//! `shards.json`: the data that all shards of an experiment share. The shard that starts first, whatever its
//! number, writes the file. Shards that start later read `shards.json`.

use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::{Block, contain_each_once};
use crate::record::journals::SHARDS;
use crate::record::{cannot_make, ordinary, write_new};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The remedy for a plan that cannot be read. The remedy does not name the option `--out`, which some of the commands
/// that read plans lack.
const RESTORE: &str = "restore the file from a copy, or start the shards again in a new folder";

/// The data by which each shard checks that its inputs equal those of the other shards. The number of shards,
/// the config, its overrides, the scenes and the kernels must be equal for all shards; the config's path and
/// the version of raycl may differ.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// The number of shards into which the experiment is divided.
    pub shards: u32,
    /// The config's path as given to the shard that started first, for messages and for commands that `raycl merge`
    /// prints.
    pub config: String,
    /// The hash of the config's text and its overrides.
    pub config_hash: String,
    /// The values of the config that the option `--set` changed, each as a line of TOML.
    pub overrides: Vec<String>,
    /// The hash of each scene's content, in the config's order. If raycl places a scene's camera, the scene has one
    /// hash for each ratio of image width to height. The hashes of a scene are joined with `+`.
    pub scenes: Vec<String>,
    /// The hash of the kernels' files, built-in or not; null if a file cannot be read.
    pub kernels: Option<String>,
    /// The version of raycl that wrote the plan, with the git revision if it is known; null in files of
    /// earlier versions.
    pub raycl: Option<String>,
}

/// The plan of an experiment in shards. The plan's points do not depend on the devices: each kind of device that takes
/// part measures all points, except for casters on the host, which any host measures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShardPlan {
    /// The data about the plan's inputs, which each shard compares with its own inputs.
    #[serde(flatten)]
    pub header: Header,
    /// The points in a readable form: scene, size, strategy, local size.
    pub points: Vec<String>,
    /// For each point, the number of its combination of scene and image size, from 0.
    pub cases: Vec<usize>,
    /// The points in blocks, and the shard that measures each block.
    pub blocks: Vec<Block>,
    /// The expected time of each shard in milliseconds; an estimate if there are no earlier measurements.
    pub expected_ms: Vec<f64>,
}

impl ShardPlan {
    /// Reads the plan of a folder. If the folder has no plan, writes the plan that `make` returns. Returns an error
    /// if the header of the folder's plan differs from `header` in a field that must be equal for all shards.
    pub fn open(out: &Path, header: &Header, make: impl FnOnce() -> Result<Self>) -> Result<Self> {
        if let Some(plan) = Self::read(out)? {
            return plan.checked(header, out);
        }
        let plan = make()?;
        let text = serde_json::to_vec(&plan).map_err(|error| Error::fault(error.to_string()))?;
        std::fs::create_dir_all(out)
            .map_err(|error| cannot_make(out, &error, "choose another folder with --out DIR"))?;
        if write_new(&path(out), &text)? {
            return Ok(plan);
        }
        // Another shard wrote its plan first. All shards must use the plan that was written first: two shards
        // may expect different times, and then cut their plans into different blocks.
        let first = Self::read(out)?.ok_or_else(|| {
            Error::run(format!(
                "{SHARDS} was deleted from {} while this shard started; start the shard again",
                out.display()
            ))
        })?;
        first.checked(header, out)
    }

    /// Reads the plan of a folder; `None` if the folder has no plan. Returns an error if the plan is damaged: with a
    /// damaged plan, shards would leave out points without a message.
    pub fn read(out: &Path) -> Result<Option<Self>> {
        let path = path(out);
        if !existing::is_file(&path)? {
            return Ok(None);
        }
        let unreadable = |error: &dyn std::fmt::Display| {
            Error::input(format!("cannot read {}: {error}", path.display())).with_help(RESTORE)
        };
        let text = ordinary(&path).and_then(|()| std::fs::read(&path)).map_err(|error| unreadable(&error))?;
        let plan: Self = serde_json::from_slice(&text).map_err(|error| unreadable(&error))?;
        match plan.damage() {
            Some(damage) => {
                Err(Error::input(format!("{} is damaged: {damage}", path.display())).with_help(RESTORE))
            }
            None => Ok(Some(plan)),
        }
    }

    /// Returns a text that says which rule of plans this plan violates; `None` if it violates none.
    fn damage(&self) -> Option<&'static str> {
        let (points, shards) = (self.points.len(), self.header.shards);
        let is_shard = |block: &Block| (1..=shards).contains(&block.shard);
        let is_point = |control: usize| control < points;
        [
            (!contain_each_once(&self.blocks, points), "the blocks do not contain each point exactly once"),
            (self.cases.len() != points, "the plan's numbers of cases and points differ"),
            (!self.blocks.iter().all(is_shard), "a block names a shard that the plan does not have"),
            (
                !self.blocks.iter().all(|block| block.control.is_none_or(is_point)),
                "a control point is not in the plan's list of points",
            ),
        ]
        .into_iter()
        .find_map(|(is_violated, rule)| is_violated.then_some(rule))
    }

    /// Returns a hash of the plan's blocks.
    pub fn hash(&self) -> Result<String> {
        let blocks = serde_json::to_vec(&self.blocks).map_err(|error| Error::fault(error.to_string()))?;
        Ok(blake3::hash(&blocks).to_hex().to_string())
    }

    /// Returns the blocks of points that a shard measures.
    pub fn of_shard(&self, number: u32) -> Vec<Block> {
        self.blocks.iter().filter(|block| block.shard == number).cloned().collect()
    }

    /// Returns the block to which a point of the plan belongs; `None` if no block contains the point.
    pub fn block_of(&self, point: usize) -> Option<&Block> {
        self.blocks.iter().find(|block| block.points.contains(&point))
    }

    pub fn checked(self, wanted: &Header, out: &Path) -> Result<Self> {
        let stored = &self.header;
        let count = |header: &Header| header.shards.to_string();
        let differs = [
            ("the number of shards", stored.shards != wanted.shards, count(stored), count(wanted)),
            (
                "the config or a value of --set",
                stored.config_hash != wanted.config_hash,
                config_text(stored),
                config_text(wanted),
            ),
            ("a scene", stored.scenes != wanted.scenes, scenes(&stored.scenes), scenes(&wanted.scenes)),
            ("the source of the kernels", stored.kernels != wanted.kernels, source(stored), source(wanted)),
        ];
        let Some((what, _, there, here)) = differs.into_iter().find(|(_, differs, ..)| *differs) else {
            return Ok(self);
        };
        let message = format!(
            "{} has a different plan, because {what} differs: {there} in the folder, {here} in this command",
            out.display()
        );
        Err(Error::input(message).with_help(format!(
            "start every shard with the same config, --set values, scenes, kernels and number of shards{}, \
             or choose another folder with --out",
            versions(stored, wanted)
        )))
    }
}

/// If another version of raycl made the folder's plan, returns a text for an error's help that names both versions.
/// Returns an empty text if the versions are equal, or if a version is not known.
fn versions(stored: &Header, wanted: &Header) -> String {
    match (&stored.raycl, &wanted.raycl) {
        (Some(there), Some(here)) if there != here => {
            format!(" and with the same raycl (the folder's plan is by raycl {there}, this is raycl {here})")
        }
        _ => String::new(),
    }
}

/// Returns the path of the file `shards.json` in a folder.
pub fn path(out: &Path) -> PathBuf {
    out.join(SHARDS)
}

/// Returns a text with the beginning of the hash of the kernels' source, or a text that says why there is no hash.
fn source(header: &Header) -> String {
    let begin = |hash: &String| format!("hash {}", hash.get(..8).unwrap_or(hash));
    header.kernels.as_ref().map_or("no hash (a kernel file could not be read)".to_owned(), begin)
}

fn config_text(header: &Header) -> String {
    let hash = header.config_hash.get(..8).unwrap_or_default();
    let set = if header.overrides.is_empty() {
        String::new()
    } else {
        format!(" with {}", header.overrides.join(", "))
    };
    format!("{}{set} (hash {hash})", header.config)
}

/// Returns the number of scenes, and the first digits of at most four scenes' hashes.
fn scenes(hashes: &[String]) -> String {
    let begins: Vec<_> = hashes.iter().take(4).map(|hash| hash.get(..8).unwrap_or(hash)).collect();
    format!("{} in all (hashes {})", hashes.len(), begins.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            shards: 4,
            config: "x.toml".into(),
            config_hash: "01234567".into(),
            scenes: vec!["a".into()],
            ..Header::default()
        }
    }

    fn plan(expected_ms: f64) -> ShardPlan {
        ShardPlan { header: header(), expected_ms: vec![expected_ms], ..ShardPlan::default() }
    }

    #[test]
    fn the_first_shards_plan_counts_and_another_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let open = |header: &Header, ms| ShardPlan::open(&out, header, || Ok(plan(ms)));
        assert_eq!(open(&header(), 1.0).unwrap(), plan(1.0));
        assert_eq!(open(&header(), 2.0).unwrap(), plan(1.0));
        for (other, what) in [
            (
                Header { shards: 5, ..header() },
                "the number of shards differs: 4 in the folder, 5 in this command",
            ),
            (Header { config_hash: "76543210".into(), ..header() }, "the config or a value of --set differs"),
            (Header { scenes: vec!["b".into()], ..header() }, "a scene differs"),
            (
                Header { kernels: Some("c".repeat(64)), ..header() },
                "the source of the kernels differs: no hash (a kernel file could not be read) in the folder, hash cccccccc in this command",
            ),
        ] {
            let error = open(&other, 1.0).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(what), "{error}");
        }
        let by = Some("0.9.0 (abcdef)".to_owned());
        let elsewhere = Header { config: "y.toml".into(), raycl: by, ..header() };
        assert!(open(&elsewhere, 1.0).is_ok(), "a path or a version decides nothing");
    }

    #[cfg(unix)]
    #[test]
    fn a_plan_that_cannot_be_found_does_not_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(ShardPlan::read(folder.path()).unwrap(), None);
        let file = path(folder.path());
        std::os::unix::fs::symlink(&file, &file).unwrap();
        assert!(ShardPlan::read(folder.path()).is_err(), "the link leads to itself");
        let opened = ShardPlan::open(folder.path(), &header(), || panic!("no other plan may be made"));
        assert!(opened.is_err());
    }

    /// With a damaged plan, a shard would leave out points, or the command that `raycl merge` prints for missing
    /// points would measure no points.
    #[test]
    fn a_damaged_plan_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let block = |shard, point| Block { number: 1, shard, points: vec![point], control: Some(1) };
        let whole = ShardPlan {
            points: vec!["a".into(), "b".into()],
            cases: vec![0, 0],
            blocks: vec![block(1, 1), block(4, 0)],
            ..plan(1.0)
        };
        let read = |plan: &ShardPlan| {
            std::fs::write(path(folder.path()), serde_json::to_vec(plan).unwrap()).unwrap();
            ShardPlan::read(folder.path())
        };
        assert_eq!(read(&whole).unwrap(), Some(whole.clone()));
        let with = |blocks| ShardPlan { blocks, ..whole.clone() };
        let beyond = Block { control: Some(2), ..block(1, 0) };
        for (damaged, rule) in [
            (with(vec![block(1, 1)]), "the blocks do not contain each point exactly once"),
            (with(vec![block(0, 0), block(1, 1)]), "a block names a shard that the plan does not have"),
            (with(vec![block(5, 0), block(1, 1)]), "a block names a shard that the plan does not have"),
            (with(vec![beyond, block(1, 1)]), "a control point is not in the plan's list of points"),
            (ShardPlan { cases: vec![0], ..whole.clone() }, "the plan's numbers of cases and points differ"),
        ] {
            let error = read(&damaged).unwrap_err();
            let message = format!("{} is damaged: {rule}", path(folder.path()).display());
            assert_eq!((error.to_string(), error.exit_code(), error.remedy()), (message, 2, RESTORE));
        }
        std::fs::write(path(folder.path()), "rubbish").unwrap();
        assert_eq!(ShardPlan::read(folder.path()).unwrap_err().remedy(), RESTORE);
    }

    #[test]
    fn the_error_of_a_shard_of_another_version_of_raycl_names_both_versions() {
        let by = |raycl: Option<&str>, kernels: &str| Header {
            kernels: Some(kernels.into()),
            raycl: raycl.map(str::to_owned),
            ..header()
        };
        let help = |there: Option<&str>, here: Option<&str>| {
            let plan = ShardPlan { header: by(there, "a"), ..ShardPlan::default() };
            plan.checked(&by(here, "b"), Path::new("out")).unwrap_err().remedy().to_owned()
        };
        let (one, two) = (Some("1.0 (a)"), Some("1.0 (b)"));
        let parts =
            "start every shard with the same config, --set values, scenes, kernels and number of shards";
        let elsewhere = "or choose another folder with --out";
        let both = format!(
            "{parts} and with the same raycl (the folder's plan is by raycl 1.0 (a), this is raycl 1.0 (b)), \
             {elsewhere}"
        );
        assert_eq!(help(one, two), both);
        let same = format!("{parts}, {elsewhere}");
        assert_eq!([help(one, one), help(None, two)], [same.clone(), same]);
    }

    #[test]
    fn of_shards_that_begin_at_once_one_writes_the_plan() {
        let folder = tempfile::tempdir().unwrap();
        let plans: Vec<ShardPlan> = std::thread::scope(|scope| {
            let open = |number: u32| {
                let out = folder.path();
                scope.spawn(move || ShardPlan::open(out, &header(), || Ok(plan(f64::from(number)))).unwrap())
            };
            let threads: Vec<_> = (0..8).map(open).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(plans.iter().all(|plan| *plan == plans[0]), "{plans:?}");
    }

    #[test]
    fn at_most_four_hashes_of_scenes_are_listed() {
        let hashes: Vec<String> = (0..5).map(|digit| digit.to_string().repeat(64)).collect();
        assert_eq!(scenes(&hashes[..1]), "1 in all (hashes 00000000)");
        assert_eq!(scenes(&hashes), "5 in all (hashes 00000000, 11111111, 22222222, 33333333)");
    }

    #[test]
    fn a_plan_that_another_shard_writes_meanwhile_has_to_be_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let beaten = |other: Header| {
            let _ = std::fs::remove_file(path(out));
            ShardPlan::open(out, &header(), || {
                let theirs = ShardPlan { header: other, ..plan(7.0) };
                std::fs::write(path(out), serde_json::to_vec(&theirs).unwrap()).unwrap();
                Ok(plan(1.0))
            })
        };
        assert_eq!(beaten(header()).unwrap(), plan(7.0));
        let error = beaten(Header { shards: 5, ..header() }).unwrap_err().to_string();
        assert!(
            error.contains("the number of shards differs: 5 in the folder, 4 in this command"),
            "{error}"
        );
    }

    #[test]
    fn blocks_are_found_by_their_shard_and_by_their_points() {
        let block =
            |number, shard, points: &[usize]| Block { number, shard, points: points.to_vec(), control: None };
        let blocks = vec![block(1, 2, &[0, 3]), block(2, 1, &[1]), block(3, 2, &[2])];
        let plan = ShardPlan { blocks: blocks.clone(), ..ShardPlan::default() };
        assert_eq!(plan.of_shard(2), [blocks[0].clone(), blocks[2].clone()]);
        assert_eq!(plan.block_of(1), Some(&blocks[1]));
        assert_eq!((plan.block_of(3), plan.block_of(9)), (Some(&blocks[0]), None));
    }

    #[test]
    fn a_different_config_is_described_with_what_was_set_in_it() {
        let set = Header { overrides: vec!["a = 1".into(), "b = 2".into()], ..header() };
        assert_eq!(
            [config_text(&header()), config_text(&set)],
            ["x.toml (hash 01234567)", "x.toml with a = 1, b = 2 (hash 01234567)"]
        );
    }
}
