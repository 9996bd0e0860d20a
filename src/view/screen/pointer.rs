//! Reads every movement of the pointer with a button down, and every step of the wheel, from the events of an X server.
//! minifb, the library that opens windows, does not report these movements: it reports only which buttons are down at
//! present, and where the pointer is. A drag that begins and ends between two frames would therefore be lost.
//!
//! minifb also ignores the events by which an X server says that a part of the window's picture is lost, for example
//! because another window covered it. raycl receives these events too, since an X server can send them to several
//! programs.
//!
//! On an X server, only one program receives the presses of buttons in a window. Therefore raycl lays an
//! invisible window of its own over the window that minifb opens; the invisible window receives the events
//! instead of minifb's window.

use super::x_server::MOST_PIXELS;
use x11rb::connection::Connection as _;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    ButtonPressEvent, ChangeWindowAttributesAux, ConnectionExt as _, CreateWindowAux, EventMask, KeyButMask,
    WindowClass,
};
use x11rb::rust_connection::RustConnection;

/// The buttons that X servers report for steps of the wheel: away from the user, and towards the user.
const WHEEL: [u8; 2] = [4, 5];

/// What the pointer did, and whether the picture was lost. Distances are in pixels, to the right and down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moves {
    /// The drags with the left button.
    pub orbit: [f64; 2],
    /// The drags with the right or the middle button.
    pub pan: [f64; 2],
    /// The steps of the wheel; steps away from the user are positive.
    pub wheel: f64,
    /// True if the server has lost a part of the window's picture, so that the picture must be shown again.
    pub loses_picture: bool,
}

/// The invisible window over minifb's window, which receives the events of the pointer. The connection of the invisible
/// window also receives the Expose events of minifb's window. The X server sends an Expose event if a part of the
/// window's picture must be drawn again.
pub struct Pointer {
    connection: RustConnection,
    /// The pointer's position at the last event.
    at: [i16; 2],
}

impl Pointer {
    /// Lays the invisible window over `window`. Both windows belong to the X display that the environment
    /// variable `DISPLAY` names. Returns `None` if the server does not answer, or refuses the invisible
    /// window.
    pub fn over(window: u32) -> Option<Self> {
        let (connection, _) = RustConnection::connect(None).ok()?;
        let cover = connection.generate_id().ok()?;
        let events = EventMask::BUTTON_PRESS | EventMask::BUTTON_RELEASE | EventMask::BUTTON_MOTION;
        let values = CreateWindowAux::new().event_mask(events);
        // The invisible window has the largest possible size. The part of the invisible window that lies
        // outside the visible window has no effect. The invisible window therefore need not follow the
        // visible window's size.
        let (side, class) = (MOST_PIXELS as u16, WindowClass::INPUT_ONLY);
        connection
            .create_window(0, cover, window, 0, 0, side, side, 0, class, 0, &values)
            .ok()?
            .check()
            .ok()?;
        connection.map_window(cover).ok()?.check().ok()?;
        let values = ChangeWindowAttributesAux::new().event_mask(EventMask::EXPOSURE);
        connection.change_window_attributes(window, &values).ok()?.check().ok()?;
        Some(Self { connection, at: [0; 2] })
    }

    /// Returns what the pointer did since the last call, and whether the picture was lost.
    pub fn moves(&mut self) -> Moves {
        let mut moves = Moves::default();
        while let Ok(Some(event)) = self.connection.poll_for_event() {
            match event {
                Event::ButtonPress(event) => {
                    moves.wheel += wheel(&event);
                    moves.follow(&mut self.at, [event.event_x, event.event_y], event.state);
                }
                Event::ButtonRelease(event) => {
                    moves.follow(&mut self.at, [event.event_x, event.event_y], event.state);
                }
                Event::MotionNotify(event) => {
                    moves.follow(&mut self.at, [event.event_x, event.event_y], event.state);
                }
                Event::Expose(_) => moves.loses_picture = true,
                _ => {}
            }
        }
        moves
    }
}

impl Moves {
    /// Adds the pointer's movement from its last position `at` to the position `to`. `down` contains the
    /// buttons that were down during the movement.
    fn follow(&mut self, at: &mut [i16; 2], to: [i16; 2], down: KeyButMask) {
        let from = std::mem::replace(at, to);
        let is_down = |button: KeyButMask| down.contains(button);
        let drag = if is_down(KeyButMask::BUTTON2) || is_down(KeyButMask::BUTTON3) {
            &mut self.pan
        } else if is_down(KeyButMask::BUTTON1) {
            &mut self.orbit
        } else {
            return;
        };
        for axis in [0, 1] {
            drag[axis] += f64::from(to[axis]) - f64::from(from[axis]);
        }
    }
}

fn wheel(event: &ButtonPressEvent) -> f64 {
    let [away, towards] = WHEEL.map(|button| f64::from(u8::from(event.detail == button)));
    away - towards
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_wheel_away_from_the_user_is_positive() {
        // X servers report a step away from the user as a press of button 4, and a step towards the user as a press of
        // button 5.
        let steps = |detail: u8| wheel(&ButtonPressEvent { detail, ..ButtonPressEvent::default() });
        assert_eq!([4, 5, 1].map(steps), [1.0, -1.0, 0.0]);
    }

    #[test]
    fn ways_with_a_button_down_are_added_up_by_the_button() {
        let [none, left] = [KeyButMask::default(), KeyButMask::BUTTON1];
        let [middle, right] = [KeyButMask::BUTTON2, KeyButMask::BUTTON3];
        let (mut moves, mut at) = (Moves::default(), [3, 4]);
        // The state that an X server sends with an event contains the buttons that were down before the
        // event.
        for (to, down) in [
            ([10, 20], none),
            ([13, 18], left),
            ([14, 18], left),
            ([50, 50], none),
            ([40, 60], right),
            ([41, 60], right | left),
            ([41, 62], middle),
        ] {
            moves.follow(&mut at, to, down);
        }
        assert_eq!(moves, Moves { orbit: [4.0, -2.0], pan: [-9.0, 12.0], ..Moves::default() });
        assert_eq!(at, [41, 62]);
    }
}
