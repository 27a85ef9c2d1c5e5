//! The modes of operation with a state of their own: homing and profile position. They return commands.
//!
//! Homing has controlword bit 4 and statusword bits 10, 12 and 13:
//!
//! | method (6098h) | home |
//! | --- | --- |
//! | 35, 37 | the present position |
//! | 33, 34 | the next reference mark in negative, positive direction |
//! | 17, 18 | where the negative, positive limit switch opens |
//! | 1, 2 | the next reference mark after it, away from the switch |
//! | −3, −4 | the positive, negative stop, at which the force exceeds a threshold |
//! | −1, −2 | the next reference mark after it, away from the stop |
//!
//! The methods below 0 are the maker's own, with the numbers that maxon's EPOS4 gives them. The way to a switch or a stop
//! takes the speed 6099h:01, every other way 6099h:02.
//!
//! Profile position has set-points with the handshake of controlword bits 4, 5, 6 and 8 and statusword bits 10 and 12. One
//! set-point runs, one may wait for it. Motion through a set-point without stopping (bit 9) is not supported.

use masseter_can::cia402::{ControlBit, Controlword, StatusBit, Statusword};

use super::encoder::mark_between;
use super::motion::{MotionCommand, PositionView};

/// Way beyond any axis, increments: a search ends only at a switch or a stop.
const FAR: i32 = 1 << 30;

/// The end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Target {
    /// A reference mark.
    Mark,
    /// A limit switch.
    Switch,
    /// A stop.
    Stop,
}

/// The search of a homing method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Search {
    target: Target,
    /// Whether the search begins towards larger positions.
    is_positive: bool,
    /// Whether home is the next reference mark on the way back.
    then_mark: bool,
}

impl Search {
    /// The search of a method; none for methods without one.
    const fn of(method: i8) -> Option<Self> {
        let (target, is_positive, then_mark) = match method {
            33 | 34 => (Target::Mark, method == 34, false),
            17 | 18 => (Target::Switch, method == 18, false),
            1 | 2 => (Target::Switch, method == 2, true),
            -3 | -4 => (Target::Stop, method == -3, false),
            -1 | -2 => (Target::Stop, method == -1, true),
            _ => return None,
        };
        Some(Self { target, is_positive, then_mark })
    }

    /// The longest way from the present position.
    fn far(self, actual: i32, is_forwards: bool) -> MotionCommand {
        let way = if self.is_positive == is_forwards { FAR } else { -FAR };
        MotionCommand::MoveTo { target: actual.saturating_add(way) }
    }
}

/// The inputs of homing in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sensed {
    /// The encoder's count before and its present one.
    pub(super) counts: [i32; 2],
    /// Position actual value (6064h).
    pub(super) actual: i32,
    /// Which limit switches are closed: the negative one, the positive one.
    pub(super) limits: [bool; 2],
    /// Whether the motor pushes with the threshold's force: towards smaller positions, towards larger ones.
    pub(super) pushes: [bool; 2],
    /// Whether the demand is no motion.
    pub(super) is_at_rest: bool,
}

/// Progress of homing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Homing {
    /// Not started, or interrupted.
    #[default]
    Idle,
    /// On the way to a switch or a stop.
    Approaching(Search),
    /// On the way back, until the switch opens.
    Leaving(Search),
    /// On the way to a reference mark.
    Searching,
    /// Slowing down after home, which is at that count.
    Settling { home_counts: i32 },
    /// Done.
    Attained,
    /// The axis came to rest before home.
    Failed,
}

impl Homing {
    /// Whether the drive supports that method (6098h).
    pub(crate) const fn is_method(method: i8) -> bool {
        matches!(method, 35 | 37) || Search::of(method).is_some()
    }

    /// Whether homing is under way.
    pub(crate) const fn is_running(self) -> bool {
        !matches!(self, Self::Idle | Self::Attained | Self::Failed)
    }

    /// The state after another mode or power state was entered: an attained home position stays.
    pub(super) const fn interrupted(self) -> Self {
        if matches!(self, Self::Attained) { self } else { Self::Idle }
    }

    /// The statusword with the bits of homing.
    pub(super) const fn show(self, word: Statusword, is_at_rest: bool) -> Statusword {
        word.with(StatusBit::TargetReached, !self.is_running() && is_at_rest)
            .with(StatusBit::HOMING_ATTAINED, matches!(self, Self::Attained))
            .with(StatusBit::HOMING_ERROR, matches!(self, Self::Failed))
    }

    /// Takes a controlword, given the one before, the method (6098h) and the encoder's last count.
    pub(super) fn control(
        &mut self,
        [before, word]: [Controlword; 2],
        method: i8,
        counts: i32,
        limits: [bool; 2],
        view: PositionView,
    ) -> Option<MotionCommand> {
        let is_start = |word: Controlword| word.has(ControlBit::Start) && !word.has(ControlBit::Halt);
        if is_start(word) && !is_start(before) {
            Some(self.start(method, counts, limits, view))
        } else if !is_start(word) && self.is_running() {
            *self = Self::Idle;
            Some(MotionCommand::SlowDown)
        } else {
            None
        }
    }

    /// A search for a mark goes as far as the software position limits allow. A search for a switch or a stop ignores
    /// the limits, which have no meaning before homing.
    fn start(&mut self, method: i8, counts: i32, limits: [bool; 2], view: PositionView) -> MotionCommand {
        let [lowest, highest] = view.allowed;
        let Some(search) = Search::of(method) else { return self.attain(counts) };
        match search.target {
            Target::Mark => {
                *self = Self::Searching;
                MotionCommand::MoveTo { target: if search.is_positive { highest } else { lowest } }
            }
            Target::Switch if limits[usize::from(search.is_positive)] => {
                *self = Self::Leaving(search);
                search.far(view.actual, false)
            }
            Target::Switch | Target::Stop => {
                *self = Self::Approaching(search);
                search.far(view.actual, true)
            }
        }
    }

    /// Goes on with the search, then waits for standstill.
    pub(super) fn step(&mut self, sensed: &Sensed) -> Option<MotionCommand> {
        let [before, now] = sensed.counts;
        match *self {
            Self::Approaching(search) => {
                let end = usize::from(search.is_positive);
                match search.target {
                    Target::Switch if sensed.limits[end] => {
                        *self = Self::Leaving(search);
                        return Some(search.far(sensed.actual, false));
                    }
                    Target::Stop if sensed.pushes[end] => {
                        return Some(self.leave(search, now, sensed.actual, MotionCommand::Hold));
                    }
                    _ => self.fail_at_rest(sensed.is_at_rest),
                }
                None
            }
            Self::Leaving(search) => {
                if !sensed.limits[usize::from(search.is_positive)] {
                    return Some(self.leave(search, now, sensed.actual, MotionCommand::SlowDown));
                }
                self.fail_at_rest(sensed.is_at_rest);
                None
            }
            Self::Searching => {
                if let Some(home_counts) = mark_between(before, now) {
                    *self = Self::Settling { home_counts };
                    return Some(MotionCommand::SlowDown);
                }
                self.fail_at_rest(sensed.is_at_rest);
                None
            }
            Self::Settling { home_counts } if sensed.is_at_rest => Some(self.attain(home_counts)),
            _ => None,
        }
    }

    /// Handles a switch or a stop found at that count: home is there, or at the next mark on the way back.
    fn leave(&mut self, search: Search, counts: i32, actual: i32, end: MotionCommand) -> MotionCommand {
        if search.then_mark {
            *self = Self::Searching;
            return search.far(actual, false);
        }
        *self = Self::Settling { home_counts: counts };
        end
    }

    fn fail_at_rest(&mut self, is_at_rest: bool) {
        if is_at_rest {
            *self = Self::Failed;
        }
    }

    fn attain(&mut self, counts: i32) -> MotionCommand {
        *self = Self::Attained;
        MotionCommand::SetHome { counts }
    }
}

/// The set-points, increments of the dictionary.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct Positioning {
    /// Under way, or interrupted by a halt.
    running: Option<i32>,
    /// Waits for the running one.
    pub(super) waiting: Option<i32>,
    /// The last one reached.
    reached: Option<i32>,
    /// Statusword bit 12.
    pub(super) is_acknowledged: bool,
    /// Whether the newest set-point was clamped to the software position limits.
    pub(super) is_limited: bool,
}

impl Positioning {
    /// Takes a controlword, given the one before and the target position (607Ah).
    pub(super) fn control(
        &mut self,
        [before, word]: [Controlword; 2],
        target_position: i32,
        view: PositionView,
    ) -> Option<MotionCommand> {
        let mut command = match (before.has(ControlBit::Halt), word.has(ControlBit::Halt)) {
            (false, true) => Some(MotionCommand::SlowDown),
            (true, false) => self.running.map(|target| MotionCommand::MoveTo { target }),
            _ => None,
        };
        if word.has(ControlBit::Start) && !before.has(ControlBit::Start) {
            command = self.take_setpoint(word, target_position, view).or(command);
        }
        self.end_handshake(word);
        command
    }

    /// Starts a set-point, or lets the set-point wait. With a waiting set-point, the new one is refused without an
    /// acknowledgement.
    fn take_setpoint(
        &mut self,
        word: Controlword,
        target_position: i32,
        view: PositionView,
    ) -> Option<MotionCommand> {
        // A relative target is added to the set-point before, or to the actual position.
        let base = self.waiting.or(self.running).or(self.reached).unwrap_or(view.actual);
        let requested = if word.has(ControlBit::Relative) {
            base.saturating_add(target_position)
        } else {
            target_position
        };
        let target = view.clamp(requested);
        let is_free = self.running.is_none() && self.waiting.is_none();
        let mut command = None;
        if word.has(ControlBit::ChangeImmediately) || is_free {
            self.waiting = None;
            command = self.start(word, target);
        } else if self.waiting.is_none() {
            self.waiting = Some(target);
        } else {
            return None;
        }
        self.is_acknowledged = true;
        self.is_limited = target != requested;
        command
    }

    fn start(&mut self, word: Controlword, target: i32) -> Option<MotionCommand> {
        self.running = Some(target);
        (!word.has(ControlBit::Halt)).then_some(MotionCommand::MoveTo { target })
    }

    /// Starts the waiting set-point once the running one is over, as `is_at_rest` reports of the demand.
    pub(super) fn step(&mut self, word: Controlword, is_at_rest: bool) -> Option<MotionCommand> {
        if word.has(ControlBit::Halt) || !is_at_rest {
            return None;
        }
        if let Some(target) = self.running.take() {
            self.reached = Some(target);
        }
        let target = self.waiting.take()?;
        let command = self.start(word, target);
        self.end_handshake(word);
        command
    }

    /// Ends the acknowledgement once the master has cleared bit 4 and another set-point has room.
    fn end_handshake(&mut self, word: Controlword) {
        if !word.has(ControlBit::Start) && self.waiting.is_none() {
            self.is_acknowledged = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_methods_offered_are_those_of_the_table() {
        let methods: Vec<_> = (i8::MIN..=i8::MAX).filter(|&method| Homing::is_method(method)).collect();
        assert_eq!(methods, [-4, -3, -2, -1, 1, 2, 17, 18, 33, 34, 35, 37]);
    }
}
