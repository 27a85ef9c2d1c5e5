//! A scenario as a whole: read from TOML, checked, and written back as resolved.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use masseter_model::geometry::{AXES, AXIS_NAMES, LEGS, MechanismConfig};
use toml::Table;

use super::document::{Document, malformed, value_at};
use super::drive_profile::over_kinds;
use super::error::{
    Checked, LONGEST_S, ScenarioError, ranges_of, read_limited, require, require_each, require_range,
    require_word,
};
use super::force::require_cell;
use super::jaw::over_food;
use super::matrix::Matrix;
use super::merge::{LISTS, append_lists, merge, robot_tables, with_absolute_paths};
use super::when::{EntryNames, refuse_circles};
use super::{
    AxisScale, CanConfig, ChecksConfig, ControllerConfig, DriveProfile, DrivesConfig, DryConfig,
    DynamicsConfig, ExpectConfig, FaultConfig, FoodConfig, ForceControlConfig, ForceEstimateConfig,
    ForceFusion, ForceSource, JawConfig, LoadCellConfig, MotionConfig, RealtimeConfig, RecordingConfig,
    RequirementConfig, StimulusConfig, StudyConfig, TeethConfig, ToothConfig, TrajectoryLimitsConfig,
    dynamics,
};
use crate::input::{excerpt, read_text};
use crate::wording::nearest;

/// Size of the largest scenario file, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// Longest time after a safe stop, s.
const LONGEST_OBSERVATION_S: f64 = 10.0;
/// Shortest motion, s: a hundred samples at 1 kHz.
const SHORTEST_MOTION_S: f64 = 0.1;

/// Nanoseconds in a second.
const SECOND_NS: u64 = 1_000_000_000;

/// Rates at which the rig can be asked to run, Hz.
pub const RATES_HZ: std::ops::RangeInclusive<u32> = 10..=20_000;

section! {
    /// The whole configuration of a run.
    pub struct Scenario {
        /// Name of the run; the name of its folder ends with it.
        pub name: String = "chewing".to_owned() => "1 to 64 letters, digits, `-`, `_`",
        /// The file of the robot, whose tables this scenario changes; the built-in defaults when absent.
        #[serde(skip_serializing)]
        pub robot: Option<PathBuf> = None,
        /// Files of other scenarios whose values this one takes over, and changes.
        #[serde(skip_serializing)]
        pub include: Vec<PathBuf> = Vec::new(),
        /// Words by which a suite chooses its scenarios.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub tags: Vec<String> = Vec::new(),
        /// Values of which a suite plays every combination.
        #[serde(skip_serializing)]
        pub matrix: Matrix = Matrix::default(),
        /// Seed of every random number: encoder noise, frames that a fault acts on.
        pub seed: u64 = 1,
        /// Cycles per second.
        pub rate_hz: u32 = 1000 => Within(*RATES_HZ.start() as f64, *RATES_HZ.end() as f64),
        /// Duration of the motion; by default that of a recorded motion, otherwise ten seconds. A generated motion ends
        /// in the closed pose if the duration has room for a cycle and half a second, otherwise within a cycle.
        pub duration_s: Option<f64> = None => Within(SHORTEST_MOTION_S, LONGEST_S),
        /// The motion of the jaw.
        pub motion: MotionConfig = MotionConfig::default(),
        /// The place of the jaw on the platform.
        pub jaw: JawConfig = JawConfig::default(),
        /// Limits of the motion.
        pub limits: TrajectoryLimitsConfig = TrajectoryLimitsConfig::default(),
        /// The mechanism's dimensions.
        pub mechanism: MechanismConfig = MechanismConfig::default(),
        /// The controller.
        pub controller: ControllerConfig = ControllerConfig::default(),
        /// Values of the controller's parameters at the start, by their names.
        #[serde(skip_serializing_if = "BTreeMap::is_empty")]
        pub parameters: BTreeMap<String, f64> = BTreeMap::new(),
        /// The CAN link.
        pub can: CanConfig = CanConfig::default(),
        /// The drives.
        pub drives: DrivesConfig = DrivesConfig::default(),
        /// What the master expects of each kind of drive; the emulated drives when absent.
        #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "over_kinds")]
        pub drive_profile: Vec<DriveProfile> = Vec::new(),
        /// The dry run.
        pub dry: DryConfig = DryConfig::default(),
        /// The emulated mechanism.
        pub dynamics: DynamicsConfig = DynamicsConfig::default(),
        /// The teeth of the emulated jaw; when absent they never meet.
        pub teeth: Option<TeethConfig> = None,
        /// Food between the teeth of the emulated jaw; none when absent.
        #[serde(deserialize_with = "over_food")]
        pub food: Option<FoodConfig> = None,
        /// The load cell of the emulated jaw; none when absent.
        pub load_cell: Option<LoadCellConfig> = None,
        /// Estimate of the bite force; none when absent, unless the bite force is controlled by it.
        pub force_estimate: Option<ForceEstimateConfig> = None,
        /// Control of the bite force; position control only when absent.
        pub force_control: Option<ForceControlConfig> = None,
        /// The scheduling of the real-time processes.
        pub realtime: RealtimeConfig = RealtimeConfig::default(),
        /// What is recorded.
        pub recording: RecordingConfig = RecordingConfig::default(),
        /// The limits beyond which the run fails.
        pub checks: ChecksConfig = ChecksConfig::default(),
        /// Faults of every layer.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub faults: Vec<FaultConfig> = Vec::new(),
        /// What happens during the motion.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub stimulus: Vec<StimulusConfig> = Vec::new(),
        /// What must hold.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub require: Vec<RequirementConfig> = Vec::new(),
        /// The expected outcome; that every check passes when absent.
        pub expect: Option<ExpectConfig> = None,
        /// The run's place in a study, and the choice of its jaw cycles.
        pub study: Option<StudyConfig> = None,
    }
}

impl Scenario {
    /// A refusal with its place in the file of the scenario, if the file alone causes it: an argument may have replaced
    /// the value.
    #[must_use]
    pub fn place_refusal(mut refusal: ScenarioError, path: &Path) -> ScenarioError {
        let in_words = refusal.to_string();
        if let ScenarioError::BadValue { place, entry, key, .. } = &mut refusal {
            *place = place_of_refusal(path, &in_words, key, *entry);
        }
        refusal
    }

    /// The place in its file of the key at the beginning of a refusal of the whole scenario. None for a file without
    /// this value: an argument may have replaced it.
    pub fn place_of(&self, path: &Path, refusal: &str) -> Option<String> {
        let is_of_key = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
        self.place_of_key(path, refusal.split(|c| !is_of_key(c)).next()?, None)
    }

    /// The place in its file of a key, or of its table for an absent key. `entry` is the number of the table in a list
    /// of tables, from 0. None for a file without the value of this scenario: an argument may have replaced it.
    pub fn place_of_key(&self, path: &Path, key: &str, entry: Option<usize>) -> Option<String> {
        let value_in = |scenario: &Self| value_at(&serde_json::to_value(scenario).ok()?, key, entry);
        let text = read_text(path, MOST_BYTES).ok()?;
        let given = Self::parse(path, &text).ok()?;
        let is_given = value_in(&given)? == value_in(self)?;
        is_given.then(|| Some(Document::parse(path, &text).ok()?.place_of(key, entry))).flatten()
    }

    /// Reads a scenario file. The paths of its files are relative to its folder. This function does not check the
    /// values: see [`Self::validate`].
    ///
    /// # Errors
    /// [`ScenarioError`] for a file that is unreadable, no regular file or larger than 1 MiB, and those of
    /// [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let text = read_limited(path, MOST_BYTES)?;
        let mut scenario = Self::parse(path, &text)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if scenario.robot.is_some() || !scenario.include.is_empty() {
            let malformed = |reason| ScenarioError::malformed_file(path, reason);
            let (mut given, mut included) = (table_of(&text), Table::new());
            for file in &scenario.include {
                let mut more = Self::read_included(&folder.join(file))
                    .map_err(|error| error.of_file_in(path, "include"))?;
                append_lists(&mut given, &mut more);
                merge(&mut included, more).map_err(malformed)?;
            }
            merge(&mut included, given).map_err(malformed)?;
            let robot = included.get("robot").and_then(toml::Value::as_str);
            let whole = robot.map_or_else(|| Ok(Table::new()), |robot| Self::read_robot(&folder.join(robot)));
            let mut whole = whole.map_err(|error| error.of_file_in(path, "robot"))?;
            merge(&mut whole, included).map_err(malformed)?;
            scenario = Self::parse(path, &whole.to_string())?;
        }
        if let Some(memory) = &mut scenario.drives.memory {
            *memory = folder.join(&*memory);
        }
        scenario.files_mut().for_each(|(_, file)| *file = folder.join(&file));
        let mut profiles = scenario.drive_profile.iter_mut();
        let read = profiles.try_for_each(|profile| profile.read_dcf(folder));
        read.map_err(|error| error.of_file_in(path, "drive_profile.dcf"))?;
        Ok(scenario)
    }

    /// The tables of a robot's file. The file is checked by itself.
    fn read_robot(path: &Path) -> Result<Table, ScenarioError> {
        let text = read_limited(path, MOST_BYTES)?;
        let alone = Self::parse(path, &text)?;
        alone.validate().map_err(|refusal| Self::place_refusal(refusal, path))?;
        robot_tables(path, table_of(&text))
    }

    /// The tables of an included file, with paths that do not depend on its folder.
    fn read_included(path: &Path) -> Result<Table, ScenarioError> {
        let text = read_limited(path, MOST_BYTES)?;
        let is_plain = Self::parse(path, &text)?.include.is_empty();
        let need = "an included file includes no other: name both in the scenario";
        let folder = path.parent().unwrap_or(Path::new(""));
        let table = with_absolute_paths(folder, table_of(&text));
        if is_plain { Ok(table) } else { Err(ScenarioError::malformed_file(path, need.to_owned())) }
    }

    /// The files of a run beside the scenario, each with the name of its copy in the run's folder.
    pub fn files_mut(&mut self) -> impl Iterator<Item = (String, &mut PathBuf)> {
        let motion = match &mut self.motion {
            MotionConfig::File(file) => Some(("motion.csv".to_owned(), &mut file.path)),
            _ => None,
        };
        let tables = self.stimulus.iter_mut().zip(1..).filter_map(|(stimulus, number)| {
            Some((format!("stimulus_{number}.csv"), stimulus.push_table.as_mut()?))
        });
        motion.into_iter().chain(tables)
    }

    /// Parses the text of a scenario; `path` is for messages only.
    ///
    /// # Examples
    /// ```
    /// use std::path::Path;
    ///
    /// use masseter_scenario::Scenario;
    ///
    /// let path = Path::new("slow.toml");
    /// let scenario = Scenario::parse(path, "rate_hz = 500")?;
    /// scenario.validate()?;
    /// assert_eq!(scenario.period_ns(), 2_000_000);
    /// let error = Scenario::parse(path, "rate_hzz = 500").unwrap_err().to_string();
    /// assert!(error.starts_with("slow.toml:1:1: unknown key") && error.ends_with("did you mean 'rate_hz'?"));
    /// # Ok::<(), masseter_scenario::ScenarioError>(())
    /// ```
    ///
    /// # Errors
    /// [`ScenarioError::Malformed`] with line, column and key, and with the most similar key for an unknown one. An
    /// array in place of a table is refused.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ScenarioError> {
        let refused = |error| malformed::<Self>(path, text, None, &error);
        let document = Document::parse(path, text).map_err(refused)?;
        let unnamed = |scenario: &Self| {
            let resolved = serde_json::to_value(scenario).expect("every part of a scenario has a JSON form");
            let (key, place) = document.unnamed_table(&resolved)?;
            let reason = format!("{key} is an array; write a table, which names its values");
            Some(ScenarioError::Malformed { place, reason })
        };
        let mut scenario: Self = toml::from_str(text).map_err(|error| {
            let every_table = Self {
                teeth: Some(TeethConfig::default()),
                food: Some(FoodConfig::default()),
                load_cell: Some(LoadCellConfig::default()),
                force_estimate: Some(ForceEstimateConfig::default()),
                force_control: Some(ForceControlConfig::default()),
                expect: Some(ExpectConfig::default()),
                study: Some(StudyConfig::default()),
                ..Self::default()
            };
            unnamed(&every_table).unwrap_or_else(|| malformed::<Self>(path, text, Some(&document), &error))
        })?;
        if let Some(refused) = unnamed(&scenario) {
            return Err(refused);
        }
        scenario.complete_model(text);
        Ok(scenario)
    }

    /// Gives an absent key of `[controller.model]` the value of `[dynamics]`.
    fn complete_model(&mut self, text: &str) {
        let Ok(given) = toml::from_str::<Table>(text) else { return };
        let model = given.get("controller").and_then(|controller| controller.get("model")?.as_table());
        let Some(model) = model else { return };
        let mut whole = Table::try_from(self.dynamics).expect("[dynamics] has a TOML form");
        merge(&mut whole, model.clone()).expect("[dynamics] has no lists");
        self.controller.model =
            Some(whole.try_into().expect("[dynamics] and [controller.model] have been read"));
    }

    /// The scenario with one changed value: `KEY=VALUE`, with the key and the value as in a file; see
    /// [`Self::with_table`] for lists. A value that is no TOML is text. A name that is no key of a scenario is the name
    /// of a parameter of the controller. This function does not check the value: see [`Self::validate`].
    ///
    /// ```
    /// use masseter_scenario::Scenario;
    ///
    /// let scenario = Scenario::default().with("controller.integral_gain_per_s=50")?;
    /// assert_eq!(scenario.controller.integral_gain_per_s, 50.0);
    /// assert_eq!(scenario.with("stiffness=3")?.parameters["stiffness"], 3.0);
    /// # Ok::<(), masseter_scenario::ScenarioError>(())
    /// ```
    ///
    /// # Errors
    /// [`ScenarioError::Malformed`] for an unknown key or a value of another type.
    pub fn with(&self, assignment: &str) -> Result<Self, ScenarioError> {
        let refused = |reason| ScenarioError::Malformed { place: excerpt(assignment), reason };
        let (key, value) = assignment
            .split_once('=')
            .filter(|(key, _)| !key.trim().is_empty())
            .ok_or_else(|| refused("write KEY=VALUE".to_owned()))?;
        if !key.contains('.') && !Self::is_key(key.trim()) {
            return self.with(&format!("parameters.{assignment}"));
        }
        let as_toml = toml::from_str::<Table>(&format!("{key} = {value}"));
        let as_text = || toml::from_str(&format!("{key} = {}", toml::Value::from(value)));
        let given = as_toml.or_else(|_| as_text()).map_err(|error| refused(error.message().to_owned()))?;
        self.with_table(given).map_err(|error| match error {
            // The place is in the resolved scenario, which the user does not see.
            ScenarioError::Malformed { reason, .. } => refused(reason),
            other => other,
        })
    }

    /// The scenario with the values of a table in place of its own. A table of another `kind` replaces the whole table.
    /// An entry of a list has the name that `after` and requirements use: `faults.NAME.at_s`.
    ///
    /// # Errors
    /// [`ScenarioError::Malformed`] for an unknown key, a value of another type, or an absent entry.
    pub fn with_table(&self, given: Table) -> Result<Self, ScenarioError> {
        let changed = Path::new("the changed scenario");
        let mut whole: Table = toml::from_str(&self.to_toml()).expect("it was written from a scenario");
        // `to_toml` omits empty lists.
        for list in LISTS {
            whole.entry(list).or_insert_with(|| toml::Value::Array(Vec::new()));
        }
        merge(&mut whole, given).map_err(|reason| ScenarioError::malformed_file(changed, reason))?;
        Self::parse(changed, &whole.to_string())
    }

    /// The question "did you mean", for a name that is similar to a key of a scenario.
    ///
    /// ```
    /// use masseter_scenario::Scenario;
    ///
    /// assert_eq!(Scenario::question_for("rate_hzz").as_deref(), Some("did you mean 'rate_hz'?"));
    /// assert_eq!(Scenario::question_for("rate_hz"), None);
    /// ```
    pub fn question_for(name: &str) -> Option<String> {
        let names = Self::KEYS.iter().map(|key| key.name);
        let likely = nearest(name, names).filter(|_| !Self::is_key(name))?;
        Some(format!("did you mean '{likely}'?"))
    }

    fn is_key(name: &str) -> bool {
        Self::KEYS.iter().any(|key| key.name == name)
    }

    /// The scenario with every default filled in, as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("every part of a scenario has a TOML form")
    }

    /// Checks every value, and values that depend on each other.
    ///
    /// # Errors
    /// [`ScenarioError::BadValue`] with key, value and valid values.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        self.validate_run()?;
        self.realtime.validate()?;
        self.can.validate()?;
        self.drives.validate()?;
        DriveProfile::validate_all(&self.drive_profile, &self.can)?;
        dynamics::validate("dynamics", &self.dynamics)?;
        self.teeth.as_ref().map_or(Ok(()), TeethConfig::validate)?;
        self.validate_entries()?;
        self.food.as_ref().map_or(Ok(()), |food| food.validate(&self.arch()))?;
        self.limits.check_ranges(ranges_of("limits"))?;
        self.dry.check_ranges(ranges_of("dry"))?;
        self.controller.validate(self.rate_hz)?;
        self.require_torque_offsets()?;
        self.validate_forces()?;
        self.checks.check_ranges(ranges_of("checks"))
    }

    fn validate_run(&self) -> Checked {
        let need = "use 1 to 64 letters, digits, '-' or '_'";
        require_word("name", &self.name, 1..=64, need)?;
        self.tags.iter().try_for_each(|tag| require_word("tags", tag, 1..=64, need))?;
        self.matrix.cases()?;
        self.study.as_ref().map_or(Ok(()), StudyConfig::validate)?;
        self.check_ranges(require_range)
    }

    /// Checks faults, stimuli and their order by `after`, then requirements and the expected outcome.
    fn validate_entries(&self) -> Checked {
        let (arch, entries) = (self.arch(), self.entry_names());
        require_each(&self.faults, |fault| fault.validate(&self.can, &entries))?;
        require_each(&self.stimulus, |stimulus| stimulus.validate(&entries, &arch))?;
        let faults = self.faults.iter().map(|fault| fault.when(&entries).map(|when| when.start));
        let stimuli = self.stimulus.iter().map(|stimulus| stimulus.when(&entries).map(|when| when.start));
        let [faults, stimuli] = [faults.collect::<Result<Vec<_>, _>>()?, stimuli.collect::<Result<_, _>>()?];
        refuse_circles(&faults, &stimuli, &entries)?;
        require_each(&self.require, RequirementConfig::validate)?;
        self.expect.as_ref().map_or(Ok(()), ExpectConfig::validate)
    }

    /// The load cell, where the estimate or the control of the bite force uses it.
    pub fn counted_cell(&self) -> Option<&LoadCellConfig> {
        let is_fused = self.force_estimate.is_some_and(|estimate| estimate.fusion == ForceFusion::LoadCell);
        let is_source = self.force_control.is_some_and(|control| control.source == ForceSource::LoadCell);
        self.load_cell.as_ref().filter(|_| is_fused || is_source)
    }

    /// Checks load cell, estimate and control of the bite force.
    fn validate_forces(&self) -> Checked {
        let estimate = self.force_estimate.unwrap_or_default();
        estimate.check_ranges(ranges_of("force_estimate"))?;
        let (cell, is_emulated) = (self.load_cell.as_ref(), self.can.is_virtual());
        if let Some(cell) = cell {
            cell.check_ranges(ranges_of("load_cell"))?;
            let need = "leave the table away with can.interfaces: the rig reads no load cell there";
            require(is_emulated, "load_cell", &"given", need)?;
        }
        let peak_n = self.force_control.map_or(0.0, |control| control.peak_n);
        estimate.require_fusible(cell, is_emulated, peak_n)?;
        if let Some(control) = &self.force_control {
            let source = || require_cell("force_control.source", cell, is_emulated, "estimate");
            let source = (control.source == ForceSource::LoadCell).then(source).transpose()?;
            control.validate(self.force_delay_s(control))?;
            source.map_or(Ok(()), |cell| cell.require_for(control))?;
        }
        if self.is_force_estimated() { dynamics::require_open_screws(&self.model().friction) } else { Ok(()) }
    }

    /// Delay of the force that this control has, s.
    pub fn source_s(&self, control: &ForceControlConfig) -> f64 {
        match (control.source, &self.load_cell) {
            (ForceSource::LoadCell, Some(cell)) => cell.time_s(),
            _ => self.force_estimate.unwrap_or_default().observer_time_s,
        }
    }

    /// Delay of the loop of this control, s, with the time until the drives have followed the command that answers a sample.
    pub fn force_delay_s(&self, control: &ForceControlConfig) -> f64 {
        let lead_s = self.controller.lead_cycles * self.period_s();
        ForceControlConfig::delay_s(lead_s, self.source_s(control))
    }

    /// The force limit of the drive of an axis (6072h), N: in force control that of a leg depends on the bite force.
    pub fn max_force_n(&self, axis: usize) -> f64 {
        let of_bite = self.force_control.filter(|_| axis >= LEGS).map(|control| control.limit_of_leg_n());
        let most_n = self.drives.of_axis(axis).max_force_n.min(of_bite.unwrap_or(f64::INFINITY));
        most_n * self.dry.force_now()
    }

    /// Whether the bite force is estimated: for the scenario's own request, or for the force control.
    pub fn is_force_estimated(&self) -> bool {
        self.force_estimate.is_some()
            || self.force_control.is_some_and(|control| control.source == ForceSource::Estimate)
    }

    /// Feed-forward needs the torque offset in the process data.
    fn require_torque_offsets(&self) -> Checked {
        let takes_none = |axis: &usize| !self.profile(*axis).pdos.rpdo1().has_torque_offset();
        let Some(axis) = (0..AXES).find(takes_none) else { return Ok(()) };
        let need = format!(
            "the drive of {} takes no torque offset; add \"60B2h\" to rpdo1 in [drive_profile.pdos], as far as the \
             drive can map the object",
            AXIS_NAMES[axis]
        );
        require(!self.controller.feed_forward_torque, "controller.feed_forward_torque", &true, need)
    }

    /// Masses and friction of the controller's model.
    pub fn model(&self) -> DynamicsConfig {
        self.controller.model.unwrap_or(self.dynamics)
    }

    /// Time of a run after a safe stop, s: the longest `stays_for`, at most ten seconds. So requirements can check that
    /// the rig stays stopped.
    pub fn observation_s(&self) -> f64 {
        let times = self.require.iter().filter_map(|requirement| requirement.stays_for);
        times.map(|time| time.si()).fold(0.0, f64::max).min(LONGEST_OBSERVATION_S)
    }

    /// The lower teeth that the jaw has, by their numbers.
    pub fn arch(&self) -> Vec<ToothConfig> {
        self.teeth.clone().unwrap_or_default().arch(&self.jaw)
    }

    /// The foods of the whole run, with those of the stimuli.
    pub fn foods(&self) -> impl Iterator<Item = &FoodConfig> {
        self.food.iter().chain(self.stimulus.iter().filter_map(|stimulus| stimulus.food.as_ref()))
    }

    /// Whether the emulated jaws can touch, by teeth or by food.
    pub fn has_contact(&self) -> bool {
        self.can.is_virtual() && (self.teeth.is_some() || self.foods().next().is_some())
    }

    /// The profile of the drive of an axis.
    pub fn profile(&self, axis: usize) -> &DriveProfile {
        DriveProfile::of_axis(&self.drive_profile, axis)
    }

    /// The scale from metres to the numbers of the drive of an axis.
    pub fn scale(&self, axis: usize) -> AxisScale {
        AxisScale::new(&self.drives.of_axis(axis), self.profile(axis), axis)
    }

    /// Longest distance of the jaw from the first pose of the motion at the start, m; none for any distance.
    pub fn start_tolerance_m(&self) -> Option<f64> {
        let on_robot_mm = (!self.can.is_virtual()).then_some(ControllerConfig::START_TOLERANCE_MM);
        self.controller.start_tolerance_mm.or(on_robot_mm).map(|tolerance_mm| tolerance_mm * 1e-3)
    }

    /// The names of the faults and stimuli.
    pub fn entry_names(&self) -> EntryNames<'_> {
        EntryNames::new(
            self.faults.iter().map(FaultConfig::name).collect(),
            self.stimulus.iter().map(StimulusConfig::name).collect(),
        )
    }

    /// Duration of a cycle, ns.
    pub fn period_ns(&self) -> u64 {
        SECOND_NS / u64::from(self.rate_hz)
    }

    /// Duration of a cycle, s.
    pub fn period_s(&self) -> f64 {
        self.period_ns() as f64 / SECOND_NS as f64
    }
}

fn table_of(text: &str) -> Table {
    toml::from_str(text).expect("the text is that of a scenario")
}

fn place_of_refusal(path: &Path, refusal: &str, key: &str, entry: Option<usize>) -> Option<String> {
    let text = read_text(path, MOST_BYTES).ok()?;
    let refused_alone = Scenario::parse(path, &text).ok()?.validate().err()?;
    let document = Document::parse(path, &text).ok()?;
    (refused_alone.to_string() == refusal).then(|| document.place_of(key, entry))
}

#[cfg(test)]
mod tests;
