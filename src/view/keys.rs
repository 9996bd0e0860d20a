//! The keys and their actions.

/// A key that the user can press. Some characters have no action ([`action`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A letter or a sign, as typed.
    Char(char),
    /// The left arrow key.
    Left,
    /// The right arrow key.
    Right,
    /// The up arrow key.
    Up,
    /// The down arrow key.
    Down,
    /// Escape.
    Escape,
}

/// An action that the user wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Move the eye around the scene, by angles in radians to the right and upwards.
    Orbit([f64; 2]),
    /// Move the eye to the right and upwards, in units of the eye's distance from the pivot (the point towards which
    /// the eye zooms).
    Pan([f64; 2]),
    /// Move the eye nearer by this number of steps; negative steps move the eye away.
    Zoom(f64),
    /// Let the eye go around the scene, or stop it.
    Spin,
    /// Change to the strategy that is this number of steps further in the list, or back if the number is
    /// negative.
    Strategy(isize),
    /// Change to the local size that is this number of steps further in the list, or back if the number is
    /// negative.
    LocalSize(isize),
    /// Change to the next device.
    Device,
    /// Show the heat map of triangle tests, or hide it.
    Tests,
    /// Go back to the scene's own camera.
    Reset,
    /// Show the keys, or hide them.
    Help,
    /// End the view.
    Quit,
}

/// A row of the table of keys: one key, or several keys with related actions.
pub struct Row {
    /// The keys' names, as the user reads them.
    pub names: &'static str,
    /// The description of the keys' actions.
    pub about: &'static str,
    /// The keys, each with its action.
    pub keys: &'static [(Key, Action)],
}

/// The angle by which a key press moves the eye around the scene, in radians.
const ORBIT: f64 = 0.1;
/// The distance by which a key press moves the eye sideways, up or down. The unit is the distance from the eye to the
/// pivot (the point towards which the eye zooms).
const PAN: f64 = 0.05;

/// All keys of `raycl view`, in the order of the list that the user sees.
pub const KEYS: &[Row] = &[
    Row {
        names: "arrows",
        about: "orbit: go around the scene",
        keys: &[
            (Key::Left, Action::Orbit([-ORBIT, 0.0])),
            (Key::Right, Action::Orbit([ORBIT, 0.0])),
            (Key::Up, Action::Orbit([0.0, ORBIT])),
            (Key::Down, Action::Orbit([0.0, -ORBIT])),
        ],
    },
    Row {
        names: "j l i k",
        about: "pan: move left, right, up, down",
        keys: &[
            (Key::Char('j'), Action::Pan([-PAN, 0.0])),
            (Key::Char('l'), Action::Pan([PAN, 0.0])),
            (Key::Char('i'), Action::Pan([0.0, PAN])),
            (Key::Char('k'), Action::Pan([0.0, -PAN])),
        ],
    },
    Row {
        names: "+ -",
        about: "zoom: come nearer, go away",
        keys: &[
            (Key::Char('+'), Action::Zoom(1.0)),
            (Key::Char('='), Action::Zoom(1.0)),
            (Key::Char('-'), Action::Zoom(-1.0)),
        ],
    },
    Row { names: "space", about: "start or stop spinning", keys: &[(Key::Char(' '), Action::Spin)] },
    Row {
        names: "s S",
        about: "the next or the previous strategy",
        keys: &[(Key::Char('s'), Action::Strategy(1)), (Key::Char('S'), Action::Strategy(-1))],
    },
    Row {
        names: "w W",
        about: "the next or the previous local size",
        keys: &[(Key::Char('w'), Action::LocalSize(1)), (Key::Char('W'), Action::LocalSize(-1))],
    },
    Row { names: "d", about: "the next device", keys: &[(Key::Char('d'), Action::Device)] },
    Row {
        names: "t",
        about: "heat map of triangle tests, on or off",
        keys: &[(Key::Char('t'), Action::Tests)],
    },
    Row { names: "r", about: "back to the scene's own camera", keys: &[(Key::Char('r'), Action::Reset)] },
    Row { names: "h", about: "show or hide these keys", keys: &[(Key::Char('h'), Action::Help)] },
    Row {
        names: "q Escape",
        about: "quit",
        keys: &[(Key::Char('q'), Action::Quit), (Key::Escape, Action::Quit)],
    },
];

/// Returns the action of a key; `None` if the key has no action.
pub fn action(key: Key) -> Option<Action> {
    KEYS.iter().flat_map(|row| row.keys).find(|(known, _)| *known == key).map(|(_, action)| *action)
}

/// Returns the actions of keys that arrived together, for example because a program was being compiled when
/// they were pressed. If one of the keys ends the view, no other key counts. Several steps from strategy to
/// strategy become one action, so that raycl does not compile the strategies in between. Several steps
/// through the list of local sizes also become one action, and several changes of the device count as one
/// change. A new strategy may come with another local size, and a new device with another strategy and local
/// size. Two changes of the same kind (strategy, local size or device) therefore stay separate if a change of
/// another kind lies between them.
pub fn actions(keys: &[Key]) -> Vec<Action> {
    let all: Vec<Action> = keys.iter().filter_map(|key| action(*key)).collect();
    if all.contains(&Action::Quit) {
        return vec![Action::Quit];
    }
    let mut waiting: Vec<Action> = Vec::new();
    for wanted in all {
        add(&mut waiting, wanted);
    }
    waiting.retain(|wanted| !matches!(wanted, Action::Strategy(0) | Action::LocalSize(0)));
    waiting
}

/// Adds the action `wanted` to the list `waiting`. There are three kinds of changes: of the strategy, of the
/// local size and of the device. If `wanted` and the last change in the list are changes of the same kind
/// (for example, both change the strategy), the two become one action.
fn add(waiting: &mut Vec<Action>, wanted: Action) {
    let changes =
        |action: &&mut Action| matches!(action, Action::Strategy(_) | Action::LocalSize(_) | Action::Device);
    match (waiting.iter_mut().rev().find(changes), wanted) {
        (Some(Action::Strategy(steps)), Action::Strategy(more))
        | (Some(Action::LocalSize(steps)), Action::LocalSize(more)) => *steps += more,
        (Some(Action::Device), Action::Device) => {}
        _ => waiting.push(wanted),
    }
}

/// Returns true if a key repeats its action while it is held.
pub fn repeats(key: Key) -> bool {
    matches!(action(key), Some(Action::Orbit(_) | Action::Pan(_) | Action::Zoom(_)))
}

/// Returns the lines of a table of the keys.
pub fn lines() -> impl Iterator<Item = String> {
    KEYS.iter().map(|Row { names, about, .. }| format!("{names:<9} {about}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_does_two_things() {
        let keys: Vec<Key> = KEYS.iter().flat_map(|row| row.keys).map(|(key, _)| *key).collect();
        for (index, key) in keys.iter().enumerate() {
            assert!(!keys[..index].contains(key), "{key:?}");
        }
    }

    #[test]
    fn every_key_has_its_action() {
        let named = [
            (Key::Left, Action::Orbit([-0.1, 0.0])),
            (Key::Right, Action::Orbit([0.1, 0.0])),
            (Key::Up, Action::Orbit([0.0, 0.1])),
            (Key::Down, Action::Orbit([0.0, -0.1])),
            (Key::Escape, Action::Quit),
        ];
        let typed = [
            ('j', Action::Pan([-0.05, 0.0])),
            ('l', Action::Pan([0.05, 0.0])),
            ('i', Action::Pan([0.0, 0.05])),
            ('k', Action::Pan([0.0, -0.05])),
            ('+', Action::Zoom(1.0)),
            ('=', Action::Zoom(1.0)),
            ('-', Action::Zoom(-1.0)),
            (' ', Action::Spin),
            ('s', Action::Strategy(1)),
            ('S', Action::Strategy(-1)),
            ('w', Action::LocalSize(1)),
            ('W', Action::LocalSize(-1)),
            ('d', Action::Device),
            ('t', Action::Tests),
            ('r', Action::Reset),
            ('h', Action::Help),
            ('q', Action::Quit),
        ];
        let expected = named.into_iter().chain(typed.map(|(letter, wanted)| (Key::Char(letter), wanted)));
        assert_eq!(expected.clone().count(), KEYS.iter().map(|row| row.keys.len()).sum::<usize>());
        for (key, wanted) in expected {
            assert_eq!(action(key), Some(wanted), "{key:?}");
        }
    }

    #[test]
    fn a_rows_name_has_its_keys() {
        for row in KEYS {
            let named = |key: &Key| match key {
                Key::Char(' ') => row.names.contains("space"),
                // On many keyboards, the plus key types an equals sign if Shift is not held.
                Key::Char('=') => row.names.contains('+'),
                Key::Char(letter) => row.names.contains(*letter),
                Key::Escape => row.names.contains("Escape"),
                Key::Left | Key::Right | Key::Up | Key::Down => row.names == "arrows",
            };
            assert!(row.keys.iter().all(|(key, _)| named(key)), "{}", row.names);
        }
    }

    #[test]
    fn waiting_steps_of_one_kind_become_one_action_and_the_end_comes_first() {
        let of = |letters: &str| actions(&letters.chars().map(Key::Char).collect::<Vec<_>>());
        assert_eq!(of("sss"), [Action::Strategy(3)]);
        assert_eq!(of("SsS"), [Action::Strategy(-1)]);
        assert_eq!(of("wwW+w"), [Action::LocalSize(2), Action::Zoom(1.0)]);
        assert!(of("sSwW").is_empty());
        // Steps before and after a change of strategy or device stay separate, because the change may also
        // set another local size (and, with a device, another strategy).
        assert_eq!(of("wwsw"), [Action::LocalSize(2), Action::Strategy(1), Action::LocalSize(1)]);
        assert_eq!(
            of("s+dds"),
            [Action::Strategy(1), Action::Zoom(1.0), Action::Device, Action::Strategy(1)]
        );
        // Only changes of the strategy, the local size and the device are joined to one action; all other
        // actions stay separate. The key `x` has no action.
        assert_eq!(of("++x  "), [Action::Zoom(1.0), Action::Zoom(1.0), Action::Spin, Action::Spin]);
        assert_eq!(of("sqw"), [Action::Quit]);
    }

    #[test]
    fn only_movement_repeats() {
        assert!(repeats(Key::Left) && repeats(Key::Char('+')));
        assert!(!repeats(Key::Char('s')) && !repeats(Key::Escape) && !repeats(Key::Char('x')));
        assert_eq!(action(Key::Char('S')), Some(Action::Strategy(-1)));
    }
}
