//! The drive: the modes of operation, stops, and what the statusword shows.

use crate::axis::Axis;
use crate::dictionary::{Address, Dictionary};
use crate::homing::Homing;
use crate::settings::Settings;
use crate::state::State;

pub(crate) const CONTROLWORD: Address = (0x6040, 0);
const STATUSWORD: Address = (0x6041, 0);
const MODE: Address = (0x6060, 0);
const TARGET: Address = (0x607A, 0);
const POSITION: i64 = 1;
const HOMING: i64 = 6;
const CYCLIC: i64 = 8;

const START: u16 = 1 << 4;
const RELATIVE: u16 = 1 << 6;
const HALT: u16 = 1 << 8;
const REMOTE: u16 = 1 << 9;
const REACHED: u16 = 1 << 10;
const LIMITED: u16 = 1 << 11;
const FOLLOWS: u16 = 1 << 12;
const FOLLOWING_ERROR: u16 = 1 << 13;

/// The emergency code of a following error.
const FOLLOWING_ERROR_CODE: u16 = 0x8611;
/// 6065h without supervision.
const NO_WINDOW: i64 = 0xFFFF_FFFF;
/// Torque while it moves, and while it presses against a stop without 6072h, per mille.
const FRICTION: f64 = 50.0;
const RATED: i64 = 1000;
/// 60A9h and 60AAh without prefix: rpm and rpm/s.
const RPM: i64 = 0xB4_4700;
const RPM_PER_SECOND: i64 = 0xC0_0300;
/// SYNC counts as present for that long, ns.
const SYNC_MEMORY_NS: u64 = 1_000_000_000;

/// Power, mode and axis.
#[derive(Debug)]
pub(crate) struct Drive {
    settings: Settings,
    state: State,
    axis: Axis,
    homing: Homing,
    mode: i64,
    word: u16,
    goal: f64,
    /// Speed of the cyclic mode, increments/s.
    pace: f64,
    is_limited: bool,
    outside_since_ns: Option<u64>,
    synced_ns: Option<u64>,
    stepped_ns: u64,
}

impl Drive {
    /// A drive without power.
    pub(crate) fn new(settings: Settings, now_ns: u64) -> Self {
        let mut axis = Axis::new(settings.position_increments, settings.stops_increments);
        if settings.quirks.is_incremental {
            axis.redefine(0.0);
        }
        Self {
            settings,
            state: State::SwitchOnDisabled,
            homing: Homing::Idle,
            mode: 0,
            word: 0,
            goal: axis.actual(),
            axis,
            pace: 0.0,
            is_limited: false,
            outside_since_ns: None,
            synced_ns: None,
            stepped_ns: now_ns,
        }
    }

    /// The application starts anew. The axis stays where it is; an incremental encoder forgets where that is.
    pub(crate) fn restart(&mut self) {
        self.axis.hold();
        if self.settings.quirks.is_incremental {
            self.axis.redefine(0.0);
        }
        (self.state, self.homing, self.mode, self.word) = (State::SwitchOnDisabled, Homing::Idle, 0, 0);
        (self.goal, self.outside_since_ns) = (self.axis.actual(), None);
    }

    /// Takes the controlword in the dictionary; true if it reset a fault.
    pub(crate) fn command(&mut self, dictionary: &Dictionary) -> bool {
        let word = dictionary.number(CONTROLWORD) as u16;
        let before = self.state;
        let stays = dictionary.number((0x605A, 0)) > 4;
        let after = before.after(word, self.word, stays);
        let is_powered = !self.settings.quirks.safe_torque_off || after == State::Fault;
        self.state = if is_powered { after } else { State::SwitchOnDisabled };
        if self.state == State::OperationEnabled && before != State::OperationEnabled {
            self.axis.hold();
            self.goal = self.axis.actual();
        }
        self.take_mode(dictionary);
        let is_start = word & !self.word & START != 0;
        if is_start && self.state == State::OperationEnabled {
            self.start(dictionary, word);
        }
        self.word = word;
        before == State::Fault && self.state != State::Fault
    }

    /// The master has fallen silent: 6007h decides.
    pub(crate) fn lose_master(&mut self, dictionary: &Dictionary) {
        match dictionary.number((0x6007, 0)) {
            1 => self.fail(),
            2 => self.state = State::SwitchOnDisabled,
            3 if self.state == State::OperationEnabled => self.state = State::QuickStopActive,
            3 if self.state != State::QuickStopActive && self.state != State::Fault => {
                self.state = State::SwitchOnDisabled;
            }
            _ => {}
        }
    }

    /// SYNC: the cyclic mode takes its target.
    pub(crate) fn sync(&mut self, dictionary: &Dictionary, now_ns: u64) {
        let interval_ns = self.synced_ns.replace(now_ns).map_or(0, |last_ns| now_ns - last_ns);
        if self.mode != CYCLIC || self.state != State::OperationEnabled {
            return;
        }
        self.goal = self.within_limits(dictionary, dictionary.number(TARGET) as f64);
        let exponent = dictionary.number((0x60C2, 2)) as i32;
        let period_s = dictionary.number((0x60C2, 1)) as f64 * 10_f64.powi(exponent);
        let period_s = if period_s > 0.0 { period_s } else { interval_ns as f64 / 1e9 };
        self.pace = (self.goal - self.axis.demand()).abs() / period_s.max(1e-6);
    }

    /// Moves on to that time; the emergency code of an error that occurs.
    pub(crate) fn step(&mut self, dictionary: &mut Dictionary, now_ns: u64) -> Option<u16> {
        let dt_s = now_ns.saturating_sub(self.stepped_ns) as f64 / 1e9;
        self.stepped_ns = now_ns;
        self.take_mode(dictionary);
        self.act(dictionary, dt_s);
        let error = self.supervise(dictionary, now_ns);
        self.show(dictionary, now_ns);
        error
    }

    fn act(&mut self, dictionary: &Dictionary, dt_s: f64) {
        let [profile, quick_stop] = [0x6084, 0x6085].map(|index| self.acceleration(dictionary, (index, 0)));
        match (self.state, self.mode) {
            (State::OperationEnabled, POSITION | HOMING) if self.word & HALT != 0 => {
                self.axis.brake(profile, dt_s);
            }
            (State::OperationEnabled, POSITION) => {
                let speed = self.velocity(dictionary, (0x6081, 0));
                self.axis.approach(self.goal, speed, dt_s);
            }
            (State::OperationEnabled, HOMING) => {
                let (home, speed, sign) = self.homing_arguments(dictionary);
                self.homing = self.homing.step(dictionary, &mut self.axis, home, speed, sign, dt_s);
            }
            (State::OperationEnabled, CYCLIC) => self.axis.approach(self.goal, self.pace, dt_s),
            (State::QuickStopActive, _) => {
                let option = dictionary.number((0x605A, 0));
                self.axis.brake(if option == 0 { 0.0 } else { quick_stop }, dt_s);
                if self.axis.velocity() == 0.0 && option <= 4 {
                    self.state = State::SwitchOnDisabled;
                }
            }
            _ => self.axis.hold(),
        }
    }

    /// A following error of longer than 6066h stops the drive.
    fn supervise(&mut self, dictionary: &Dictionary, now_ns: u64) -> Option<u16> {
        let window = dictionary.number((0x6065, 0));
        let is_supervised =
            self.state == State::OperationEnabled && window != NO_WINDOW && self.mode != HOMING;
        let error = (self.axis.demand() - self.axis.actual()).abs();
        if !is_supervised || error <= window as f64 {
            self.outside_since_ns = None;
            return None;
        }
        let since_ns = *self.outside_since_ns.get_or_insert(now_ns);
        let limit_ns = dictionary.number((0x6066, 0)) as u64 * 1_000_000;
        (now_ns - since_ns >= limit_ns).then(|| {
            self.fail();
            FOLLOWING_ERROR_CODE
        })
    }

    fn fail(&mut self) {
        self.state = State::Fault;
        self.axis.hold();
    }

    fn show(&self, dictionary: &mut Dictionary, now_ns: u64) {
        let is_enabled = self.state == State::OperationEnabled;
        let is_there = self.axis.is_at(self.goal) && (self.axis.actual() - self.goal).abs() <= 1.0;
        let flag = |bit, is_set| if is_set { bit } else { 0 };
        let of_mode = match self.mode {
            POSITION => {
                flag(FOLLOWS, self.word & START != 0) | flag(REACHED, is_there || self.word & HALT != 0)
            }
            HOMING => self.homing.bits(),
            CYCLIC => {
                let has_sync = self.synced_ns.is_some_and(|at_ns| now_ns - at_ns < SYNC_MEMORY_NS);
                flag(FOLLOWS, is_enabled) | flag(HALT, has_sync && self.settings.quirks.shows_sync)
            }
            _ => 0,
        };
        let error = flag(FOLLOWING_ERROR, self.outside_since_ns.is_some());
        let limited = flag(LIMITED, self.is_limited && is_enabled);
        let status = self.state.bits() | REMOTE | of_mode | error | limited;
        let strongest = if dictionary.has((0x6072, 0)) { dictionary.number((0x6072, 0)) } else { RATED };
        let pressed = self.axis.pressing() * strongest as f64;
        let moved = if self.axis.velocity() == 0.0 { 0.0 } else { FRICTION.copysign(self.axis.velocity()) };
        let velocity = self.axis.velocity() / self.velocity_unit(dictionary);
        dictionary.put(STATUSWORD, status.into());
        dictionary.put((0x6061, 0), self.mode);
        dictionary.put((0x6062, 0), self.axis.demand().round() as i64);
        dictionary.put((0x6064, 0), self.axis.actual().round() as i64);
        dictionary.put((0x606C, 0), velocity.round() as i64);
        dictionary.put((0x6077, 0), if pressed == 0.0 { moved } else { pressed } as i64);
        dictionary.put((0x60F4, 0), (self.axis.demand() - self.axis.actual()).round() as i64);
        dictionary.put((0x60FD, 0), self.axis.inputs(self.settings.home_increments));
    }

    /// A change of the mode ends what the former one did.
    fn take_mode(&mut self, dictionary: &Dictionary) {
        let mode = dictionary.number(MODE);
        if mode != self.mode {
            (self.mode, self.homing, self.is_limited) = (mode, Homing::Idle, false);
            (self.goal, self.pace) = (self.axis.demand(), 0.0);
        }
    }

    fn start(&mut self, dictionary: &Dictionary, word: u16) {
        if self.mode == POSITION {
            let base = if word & RELATIVE == 0 { 0.0 } else { self.goal };
            self.goal = self.within_limits(dictionary, base + dictionary.number(TARGET) as f64);
        } else if self.mode == HOMING {
            let (home, speed, sign) = self.homing_arguments(dictionary);
            self.homing = Homing::start(dictionary, &mut self.axis, home, speed, sign);
        }
    }

    /// Where 6064h has the home switch, the speed of the search, and the sign of 607Ch.
    fn homing_arguments(&self, dictionary: &Dictionary) -> (f64, f64, f64) {
        let sign = if self.settings.quirks.is_home_offset_positive { 1.0 } else { -1.0 };
        (self.axis.reading_of(self.settings.home_increments), self.velocity(dictionary, (0x6099, 1)), sign)
    }

    /// A target within 607Dh; limits that leave no room, as 0 and 0, are none.
    fn within_limits(&mut self, dictionary: &Dictionary, target: f64) -> f64 {
        let [lowest, highest] = [1, 2].map(|subindex| dictionary.number((0x607D, subindex)) as f64);
        self.is_limited = lowest < highest && !(lowest..=highest).contains(&target);
        if self.is_limited { target.clamp(lowest, highest) } else { target }
    }

    fn velocity(&self, dictionary: &Dictionary, address: Address) -> f64 {
        dictionary.number(address) as f64 * self.velocity_unit(dictionary)
    }

    /// Increments/s of one unit of velocity.
    fn velocity_unit(&self, dictionary: &Dictionary) -> f64 {
        self.unit(dictionary, (0x60A9, 0), RPM)
    }

    /// Increments/s².
    fn acceleration(&self, dictionary: &Dictionary, address: Address) -> f64 {
        dictionary.number(address) as f64 * self.unit(dictionary, (0x60AA, 0), RPM_PER_SECOND)
    }

    /// The length of a unit that counts in turns; all others count in increments.
    fn unit(&self, dictionary: &Dictionary, address: Address, turns: i64) -> f64 {
        let code = dictionary.number(address);
        if code & 0xFF_FF00 != turns {
            return 1.0;
        }
        let [increments, revolutions] = [1, 2].map(|subindex| dictionary.number((0x608F, subindex)) as f64);
        let has_resolution = increments > 0.0 && revolutions > 0.0;
        let of_settings = f64::from(self.settings.increments_per_turn);
        let per_turn = if has_resolution { increments / revolutions } else { of_settings };
        per_turn / 60.0 * 10_f64.powi(i32::from((code >> 24) as i8))
    }
}
