//! Parameters of a robot from the recording of a run: a rig that steps gets the recorded commands, and its parameters are
//! fitted until its readings are the recorded ones.
//!
//! Commands are enough, so any controller may have given them. The numbers are those of [`fit`]. No controller is
//! played here, and no verdict is judged.

mod fit;
#[cfg(test)]
mod tests;

use masseter_model::geometry::AXES;
use masseter_recording::{FolderError, ReadError, Reader, Recorded, Topic};
use masseter_runtime::messages::codes::DriveState;
use masseter_runtime::messages::{Command, Reading};
use masseter_virtual_time::{Requests, Rig, RigError};
use serde::Serialize;

use fit::{BLOCKS, Estimate, Fit, Model, Noise, Row, Unknown};

use crate::prelude::*;

/// Fewest cycles of moving drives.
const FEWEST_CYCLES: usize = 50 * BLOCKS;
/// Cycles that are fitted at most: a minute at 2 kHz.
const MOST_CYCLES: usize = 120_000;
/// Cycles between two looks at the user's requests.
const LOOK_CYCLES: u64 = 1024;
/// Bits of a reading whose axes are all fresh.
const ALL_AXES: u32 = (1 << AXES) - 1;
/// Increment of an encoder without noise, m.
const FINE_M: f64 = 1e-9;

/// Plays that are tried, m.
const PLAYS_M: [f64; 10] = [0.5e-4, 1e-4, 1.5e-4, 2e-4, 2.5e-4, 3e-4, 3.5e-4, 4e-4, 4.5e-4, 5e-4];

/// A key of the scenario that is fitted.
#[derive(Clone, Copy)]
struct Key {
    name: &'static str,
    /// The least value that is told from zero.
    least: f64,
    /// The difference for a slope, in shares of the value.
    difference: f64,
    /// Values in whose neighbourhoods the best one may lie.
    valleys: &'static [f64],
    at: fn(&mut Scenario) -> &mut f64,
}

/// The keys that are fitted. The gain of a position loop is the inverse of its lag.
const KEYS: [Key; 8] = [
    Key::new("dynamics.slide_friction_n", 1.0, |of| &mut of.dynamics.slide_friction_n),
    Key::new("dynamics.viscous_friction_n_s_per_m", 5.0, |of| &mut of.dynamics.viscous_friction_n_s_per_m),
    Key::new("dynamics.carriage_mass_kg", 0.1, |of| &mut of.dynamics.carriage_mass_kg),
    Key::new("dynamics.rod_mass_kg", 0.1, |of| &mut of.dynamics.rod_mass_kg),
    Key::new("dynamics.platform_mass_kg", 0.1, |of| &mut of.dynamics.platform_mass_kg),
    Key::play("dynamics.axes.slide_play_m", |of| &mut of.dynamics.axes.slide_play_m),
    Key::new("drives.slide.position_gain_per_s", 10.0, |of| &mut of.drives.slide.position_gain_per_s),
    Key::new("drives.leg.position_gain_per_s", 10.0, |of| &mut of.drives.leg.position_gain_per_s),
];

impl Key {
    const fn new(name: &'static str, least: f64, at: fn(&mut Scenario) -> &mut f64) -> Self {
        Self { name, least, difference: 0.02, valleys: &[], at }
    }

    /// A play. Its effect is a short dip of the force at each reversal, and dips that do not overlap show no slope.
    const fn play(name: &'static str, at: fn(&mut Scenario) -> &mut f64) -> Self {
        Self { name, least: 1e-4, difference: 0.1, valleys: &PLAYS_M, at }
    }
}

/// Why a recording gives no parameters, and what to do.
#[derive(Debug, thiserror::Error)]
pub(crate) enum IdentifyError {
    /// There is no run, or the run has no recording.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The scenario or the manifest cannot be read.
    #[error("{0:#}")]
    Run(anyhow::Error),
    /// A part of the file is missing or damaged.
    #[error("the recording is incomplete: 'masseter recording verify' says where; record the run again")]
    Incomplete,
    /// Messages of a topic are missing.
    #[error(
        "the recording lacks {} on '{topic}', so what moved the drives is unknown: record the run again, and do not thin it",
        counted(*.missing, "message")
    )]
    Gap { topic: &'static str, missing: u64 },
    /// The drives did without a command, or without SYNC.
    #[error(
        "in {} the command came late or SYNC was left out, which a rig that steps cannot repeat: record the run again where \
         'masseter doctor' finds no fault, or with --clock lockstep",
        counted(*.cycles, "cycle")
    )]
    Late { cycles: u64 },
    /// The drives did not move for long enough.
    #[error(
        "all drives were in operation for {cycles} cycles, and at least {FEWEST_CYCLES} are needed: record a longer motion"
    )]
    Short { cycles: usize },
    /// No rig has the scenario.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The plant failed.
    #[error(
        "the rig of the scenario fails under the recorded commands: begin with values nearer to the robot's, by --set KEY=VALUE"
    )]
    Unplayable,
    /// The user ended it.
    #[error("interrupted: nothing was identified")]
    Interrupted,
}

/// What a recording says of a key.
#[derive(Debug, Serialize)]
pub(crate) struct Identified {
    pub(crate) key: &'static str,
    /// The value that the fit began with.
    pub(crate) start: f64,
    /// The value with the ends of its 95 % interval; none where the recording does not determine it.
    pub(crate) found: Option<Found>,
}

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Found {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// What a recording says of all keys.
#[derive(Debug, Serialize)]
pub(crate) struct Answer {
    pub(crate) keys: Vec<Identified>,
    /// Cycles that were fitted.
    pub(crate) cycles: usize,
    /// Distance of the recording from the rig by the noise of both, rms: 1 where the rig explains the recording.
    pub(crate) misfit: f64,
    /// The scenario with the values that were found.
    #[serde(skip)]
    pub(crate) scenario: Scenario,
}

/// Finds the parameters of a recorded run. The fit begins with the scenario of the run, changed by `set`.
pub(crate) fn identify(
    run: &std::path::Path,
    set: &[String],
    requests: &(dyn Requests + Sync),
) -> Result<Answer, IdentifyError> {
    let folder = RunFolder::open(run)?;
    let manifest = Manifest::read(&folder).map_err(|error| IdentifyError::Run(error.into()))?;
    let scenario = scenario_with(Some(&folder.scenario()), set).map_err(IdentifyError::Run)?;
    let played = Played::read(&folder, manifest.is_in_real_time())?;
    played.identify(scenario, requests)
}

/// The commands of a run, and the readings that followed.
#[derive(Debug, Default)]
struct Played {
    /// Of the cycles from the first on.
    commands: Vec<Option<Command>>,
    /// Whether the reading after each of these cycles is fitted: all drives are in operation.
    is_fitted: Vec<bool>,
    /// The readings that are fitted.
    rows: Vec<Row>,
}

impl Played {
    fn read(folder: &RunFolder, is_in_real_time: bool) -> Result<Self, IdentifyError> {
        let mut reader = Reader::open(&folder.recording())?;
        let (mut sequence, mut played) = (masseter_judge::SequenceCheck::default(), Self::default());
        let mut late = 0;
        while let Some(message) = reader.next_message()? {
            sequence.take(&message);
            match message {
                Recorded::Command(command) => played.take_command(command),
                Recorded::Reading(reading) => late += u64::from(!played.take_reading(&reading)),
                _ => {}
            }
        }
        if reader.was_cut_short() || !reader.damage().is_empty() {
            return Err(IdentifyError::Incomplete);
        }
        let needed = [Topic::Reading, Topic::Command].map(Topic::name);
        let gap = sequence.finish().into_iter().find(|of| of.missing > 0 && needed.contains(&of.topic));
        if let Some(masseter_judge::TopicFigures { topic, missing, .. }) = gap {
            return Err(IdentifyError::Gap { topic, missing });
        }
        if is_in_real_time && late > 0 {
            return Err(IdentifyError::Late { cycles: late });
        }
        played.trim();
        let cycles = played.rows.len();
        if cycles < FEWEST_CYCLES { Err(IdentifyError::Short { cycles }) } else { Ok(played) }
    }

    /// Leaves out what comes after the controller's last command: then the master stops the drives by itself.
    fn trim(&mut self) {
        self.commands.truncate(self.is_fitted.len());
        self.is_fitted.truncate(self.commands.len());
        self.rows.truncate(self.is_fitted.iter().filter(|is_fitted| **is_fitted).count());
    }

    fn take_command(&mut self, command: Command) {
        let place = (command.cycle as usize).saturating_sub(1);
        if place < MOST_CYCLES {
            self.commands.resize(self.commands.len().max(place + 1), None);
            self.commands[place] = Some(command);
        }
    }

    /// Takes a reading; returns whether the drives had the command of the cycle before, and no SYNC was left out.
    fn take_reading(&mut self, reading: &Reading) -> bool {
        let before = reading.cycle.saturating_sub(1);
        if (1..=MOST_CYCLES as u64).contains(&before) {
            let is_moving =
                reading.drive_state.iter().all(|state| *state == DriveState::OperationEnabled.code());
            let is_fitted = is_moving && reading.fresh_axes == ALL_AXES;
            self.is_fitted.push(is_fitted);
            if is_fitted {
                self.rows.push(row(reading.position_m, reading.force_n));
            }
        }
        reading.skipped_cycles == 0 && (reading.answers_cycle == before || reading.answers_cycle == 0)
    }

    /// Fits the rig of a scenario.
    fn identify(
        &self,
        scenario: Scenario,
        requests: &(dyn Requests + Sync),
    ) -> Result<Answer, IdentifyError> {
        let mut scenario = scenario;
        scenario.can.interfaces.clear();
        Rig::new(&scenario, scenario.seed)?;
        let unknown = |key: &Key| {
            let (Key { least, difference, valleys, .. }, start) = (*key, *(key.at)(&mut scenario.clone()));
            // A play is anywhere among those that are tried; another value is known to its double.
            let spread = valleys.last().copied().unwrap_or(start.max(least));
            Unknown { start, least, difference, spread, valleys }
        };
        let unknowns = KEYS.each_ref().map(unknown);
        let drive = |axis| scenario.drives.of_axis(axis);
        let finest = row(
            std::array::from_fn(|axis| drive(axis).encoder_resolution_m),
            std::array::from_fn(|axis| drive(axis).rated_force_n / 1000.0),
        );
        let model = RigModel { scenario: &scenario, played: self, requests };
        let fit = Fit::of(&model, &self.rows, &unknowns, &finest)?;
        let Fit { estimates, misfit } = fit.ok_or(IdentifyError::Unplayable)?;
        let mut found_in = scenario.clone();
        let keys = KEYS.iter().zip(unknowns).zip(estimates).map(|((key, unknown), estimate)| {
            let Estimate { value, half_width, is_determined } = estimate;
            let found = Found { value, low: (value - half_width).max(0.0), high: value + half_width };
            if is_determined {
                *(key.at)(&mut found_in) = value;
            }
            Identified { key: key.name, start: unknown.start, found: is_determined.then_some(found) }
        });
        let keys = keys.collect();
        Ok(Answer { keys, cycles: self.rows.len(), misfit, scenario: found_in })
    }
}

/// A rig that gets the recorded commands.
struct RigModel<'a> {
    scenario: &'a Scenario,
    played: &'a Played,
    requests: &'a (dyn Requests + Sync),
}

impl Model for RigModel<'_> {
    type Error = IdentifyError;

    fn play(&self, values: &[f64], noise: Noise) -> Result<Option<Vec<Row>>, IdentifyError> {
        let mut scenario = self.scenario.clone();
        for (key, value) in KEYS.iter().zip(values) {
            *(key.at)(&mut scenario) = *value;
        }
        let seed = match noise {
            // Other seeds than the recording's.
            Noise::Seed(number) => scenario.seed.wrapping_add(1 + number),
            Noise::None => {
                for drive in [&mut scenario.drives.slide, &mut scenario.drives.leg] {
                    (drive.encoder_noise_m, drive.encoder_resolution_m) = (0.0, FINE_M);
                }
                scenario.seed
            }
        };
        let Ok(mut rig) = Rig::new(&scenario, seed) else { return Ok(None) };
        let mut rows = Vec::with_capacity(self.played.rows.len());
        let mut is_interrupted = false;
        let mut fitted = self.played.is_fitted.iter();
        let steps = rig.follow(&self.played.commands, &mut |rig| {
            let reading = rig.reading();
            if fitted.next() == Some(&true) {
                // The truth has the force of 6077h in finer steps.
                let force_n = rig.truth().filter(|_| noise == Noise::None).map(|truth| truth.force_n);
                rows.push(row(reading.position_m, force_n.unwrap_or(reading.force_n)));
            }
            is_interrupted = reading.cycle.is_multiple_of(LOOK_CYCLES) && self.requests.is_stop_requested();
            !is_interrupted
        });
        if is_interrupted {
            return Err(IdentifyError::Interrupted);
        }
        // The plant of such values fails.
        Ok(steps.is_ok().then_some(rows))
    }
}

fn row(position_m: [f64; AXES], force_n: [f64; AXES]) -> Row {
    std::array::from_fn(|at| if at < AXES { position_m[at] } else { force_n[at - AXES] })
}
