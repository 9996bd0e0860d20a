//! Results of measurements: stores each measurement of a point as a record (a line of JSON), and computes summaries
//! from the files of a folder of results.

mod anchors;
mod axes;
mod clocks;
mod control;
mod delay;
mod environment;
mod file_names;
mod folder;
mod git;
mod hosts;
mod intervals;
mod journal;
pub mod journals;
mod kernel_tuner;
mod launch_end;
mod markdown;
mod modes;
mod noise;
mod one_change;
mod outcome;
mod parameters;
mod plan;
mod point_times;
mod ranking;
mod ratios;
mod relative_times;
mod repair;
mod revision;
mod rounds;
mod safe_paths;
mod sample;
mod scenes;
mod smallest_difference;
mod spreadsheet;
mod summary;
mod t4;
mod terminal;
mod together;
mod types;
mod unwritable_folder;
mod verification;
mod whole;

pub use anchors::AnchorSample;
pub use clocks::Clocks;
pub(crate) use delay::unshared_delay;
pub(crate) use environment::is_shown_as;
pub use environment::{BUILT_IN, DeviceEnvironment, Environment, Host, Source};
pub(crate) use file_names::{file_name, file_names};
pub use folder::{Folder, MERGE, latest, no_results, not_a_folder, point, read_records};
pub use git::{git_state, git_state_of_folder};
pub use hosts::{AtHost, Control, controls};
pub use intervals::renew_intervals;
pub use journal::{JsonLines, Lines, read_lines, read_lines_if_any};
pub use kernel_tuner::kernel_tuner_caches;
pub use launch_end::LaunchEnd;
pub use markdown::summary_markdown;
pub(crate) use modes::{to_mind, two_modes};
pub use noise::{Causes, Noise};
pub(crate) use one_change::{
    Change, Changes, Compared, HOW_TO_READ_CHANGES, both_sizes, changes, with_interval,
};
pub use outcome::Outcome;
pub use plan::{CurrentPlan, PlannedPoint};
pub(crate) use point_times::{fewest, interval, is_below_resolution, launches, median};
pub(crate) use ranking::{may_be_faster, ranking};
pub(crate) use ratios::{
    anchored, anchored_mean, are_together, mean_relative_to, mean_relative_to_earlier, ratio, ratio_apart,
    ratio_of_means, ratio_of_passes, rounds_of,
};
pub use relative_times::RelativeTimes;
pub use repair::{Repaired, repair};
pub use revision::dirty_program;
pub use rounds::RoundLoad;
pub(crate) use rounds::{LEAST_READINGS, MOVED, latency_ns};
pub use safe_paths::{ordinary, own_file, own_folder, read_inside, refuse_link};
pub use sample::Sample;
pub(crate) use scenes::{new_names, tell_scenes_apart};
pub(crate) use smallest_difference::{apart_note, smallest_difference_note};
pub use spreadsheet::summary_csv;
#[cfg(test)]
pub(crate) use summary::tests as fixtures;
pub use summary::{Group, groups, scene_notes};
pub(crate) use summary::{few_names, first_line, not_enough, quartiles, why_unranked};
pub use t4::t4_results;
pub use terminal::summary_terminal;
pub(crate) use terminal::{percent, word};
pub use together::{judge, judge_with_anchors};
pub use types::{HOST, Record, schema};
pub use unwritable_folder::{cannot_make, refuse_closed, refuse_file};
pub use whole::{
    TEMPORARY_PREFIX, remove_leftovers, sync_folder, temporary_in, write_json, write_new, write_page,
    write_whole, write_whole_by,
};
