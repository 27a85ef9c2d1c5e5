//! The axis: an integrator that follows its demand exactly, except beyond mechanical stops.

/// Distance within which the home switch is closed, increments.
const HOME_SWITCH: f64 = 50.0;

/// Increments that the sum of many steps may be off.
const ROUNDING: f64 = 1e-3;

/// Where the axis is. `machine` counts from the zero of the machine, all else as 6064h does.
#[derive(Debug)]
pub(crate) struct Axis {
    machine: f64,
    zero: f64,
    demand: f64,
    velocity: f64,
    stops: [f64; 2],
}

impl Axis {
    /// An axis that stands there.
    pub(crate) fn new(machine: i32, stops: Option<[i32; 2]>) -> Self {
        let stops = stops.map_or([f64::NEG_INFINITY, f64::INFINITY], |stops| stops.map(f64::from));
        let machine = f64::from(machine);
        Self { machine, zero: 0.0, demand: machine, velocity: 0.0, stops }
    }

    pub(crate) fn actual(&self) -> f64 {
        self.machine - self.zero
    }

    pub(crate) fn demand(&self) -> f64 {
        self.demand
    }

    /// Whether the demand has arrived there.
    pub(crate) fn is_at(&self, goal: f64) -> bool {
        (self.demand - goal).abs() < ROUNDING
    }

    /// Increments/s.
    pub(crate) fn velocity(&self) -> f64 {
        self.velocity
    }

    /// A place of the machine as 6064h counts it.
    pub(crate) fn reading_of(&self, machine: i32) -> f64 {
        f64::from(machine) - self.zero
    }

    /// Makes the present place have that reading.
    pub(crate) fn redefine(&mut self, reading: f64) {
        (self.zero, self.demand) = (self.machine - reading, reading);
    }

    /// Stands where it is.
    pub(crate) fn hold(&mut self) {
        (self.demand, self.velocity) = (self.actual(), 0.0);
    }

    /// Moves the demand towards a goal with at most that speed.
    pub(crate) fn approach(&mut self, goal: f64, speed: f64, dt_s: f64) {
        let reach = speed * dt_s;
        self.shift((goal - self.demand).clamp(-reach, reach), dt_s);
    }

    /// Brakes along a ramp; at once if it has no slope.
    pub(crate) fn brake(&mut self, deceleration: f64, dt_s: f64) {
        let slower = if deceleration > 0.0 { self.velocity.abs() - deceleration * dt_s } else { 0.0 };
        self.shift(slower.max(0.0).copysign(self.velocity) * dt_s, dt_s);
    }

    /// The direction in which it presses against a stop; 0 if it is free.
    pub(crate) fn pressing(&self) -> f64 {
        let [low, high] = self.stops;
        let demanded = self.demand + self.zero;
        f64::from(u8::from(demanded > high)) - f64::from(u8::from(demanded < low))
    }

    /// 60FDh: both limit switches and the home switch.
    pub(crate) fn inputs(&self, home: i32) -> i64 {
        let [low, high] = self.stops;
        let is_home = (self.machine - f64::from(home)).abs() <= HOME_SWITCH;
        i64::from(self.machine <= low) | i64::from(self.machine >= high) << 1 | i64::from(is_home) << 2
    }

    fn shift(&mut self, way: f64, dt_s: f64) {
        if dt_s > 0.0 {
            let [low, high] = self.stops;
            (self.demand, self.velocity) = (self.demand + way, way / dt_s);
            self.machine = (self.demand + self.zero).clamp(low, high);
        }
    }
}
