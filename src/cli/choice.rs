//! Arguments that several subcommands share: a device, a strategy, a local size, a number, a time, `--set`.

mod device;
mod parsers;
mod set_keys;
mod strategy;

pub use device::{one_device, one_device_with, usual_device_index};
pub use parsers::{number, parse_assignment, parse_seconds, parse_size, whole};
pub use set_keys::{is_axis, refuse_misspelt_axis, refuse_option};
pub use strategy::{StrategyText, chosen_strategy, parse_strategy, requested_strategy};
