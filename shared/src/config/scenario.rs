//! A scenario as a whole: read from TOML, checked, and written back as resolved.

use std::path::Path;

use super::document::{Document, place};
use super::error::ScenarioError;
use super::need::{LONGEST_S, SHORTEST_MOTION_S, require_within};
use super::{
    CanConfig, ChecksConfig, ControllerConfig, DrivesConfig, DynamicsConfig, FaultConfig, FoodConfig,
    JawConfig, MotionConfig, RealtimeConfig, TrajectoryLimitsConfig,
};
use crate::clock::SECOND_NS;
use crate::geometry::MechanismConfig;
use crate::input::{excerpt, read_text};

/// Size of the largest scenario file, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// Characters of the longest message of the TOML reader.
const LONGEST_REASON: usize = 2000;

/// Rates at which the rig can be asked to run, Hz.
pub(crate) const RATES_HZ: std::ops::RangeInclusive<u32> = 10..=20_000;

section! {
    /// The whole configuration of a run.
    pub struct Scenario {
        /// Name of the run, with which the name of its folder ends.
        pub name: String = "chewing".to_owned(),
        /// Seed of every random number.
        pub seed: u64 = 1,
        /// Cycles per second, Hz.
        pub rate_hz: u32 = 1000,
        /// Duration of the motion, s; when absent a recording's own length, or ten seconds. A generated motion ends closed
        /// if this holds a cycle and half a second, otherwise on its way.
        pub duration_s: Option<f64> = None,
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
        /// The CAN link.
        pub can: CanConfig = CanConfig::default(),
        /// The drives.
        pub drives: DrivesConfig = DrivesConfig::default(),
        /// The emulated mechanism.
        pub dynamics: DynamicsConfig = DynamicsConfig::default(),
        /// Food between the teeth of the emulated jaw; none when absent.
        pub food: Option<FoodConfig> = None,
        /// The scheduling of the real-time processes.
        pub realtime: RealtimeConfig = RealtimeConfig::default(),
        /// The limits beyond which the run fails.
        pub checks: ChecksConfig = ChecksConfig::default(),
        /// Faults on the buses.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub faults: Vec<FaultConfig> = Vec::new(),
    }
}

impl Scenario {
    /// A refusal with its place in the file of the scenario, if the file alone leads to it: an argument may have replaced
    /// the value.
    #[must_use]
    pub fn place_refusal(mut refusal: ScenarioError, path: &Path) -> ScenarioError {
        let in_words = refusal.to_string();
        if let ScenarioError::BadValue { place, entry, key, .. } = &mut refusal {
            *place = place_of_refusal(path, &in_words, key, *entry);
        }
        refusal
    }

    /// The place in its file of the key with which a refusal of the whole scenario begins; none where the file does not
    /// have this value: an argument may have replaced it.
    pub fn place_of(&self, path: &Path, refusal: &str) -> Option<String> {
        let is_of_key = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
        let key = refusal.split(|c| !is_of_key(c)).next()?;
        let value_in = |scenario: &Self| {
            let values = serde_json::to_value(scenario).ok()?;
            values.pointer(&format!("/{}", key.replace('.', "/"))).cloned()
        };
        let text = read_text(path, MOST_BYTES).ok()?;
        let given = Self::parse(path, &text).ok()?;
        let is_given = value_in(&given)? == value_in(self)?;
        is_given.then(|| Some(Document::parse(path, &text).ok()?.place_of(key, None))).flatten()
    }

    /// Reads a scenario file. The path of a recording is relative to the folder of the scenario. The values are not checked
    /// yet: see [`Self::validate`].
    ///
    /// # Errors
    /// [`ScenarioError`] for a file that cannot be read, is no regular file or is larger than 1 MiB, and those of
    /// [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let text = read_text(path, MOST_BYTES)
            .map_err(|error| ScenarioError::Unreadable { path: path.to_owned(), error })?;
        let mut scenario = Self::parse(path, &text)?;
        if let (MotionConfig::File(file), Some(folder)) = (&mut scenario.motion, path.parent()) {
            file.path = folder.join(&file.path);
        }
        Ok(scenario)
    }

    /// Parses the text of a scenario; `path` is for messages only.
    ///
    /// # Examples
    /// ```
    /// use std::path::Path;
    ///
    /// use masseter_shared::config::Scenario;
    ///
    /// let path = Path::new("slow.toml");
    /// let scenario = Scenario::parse(path, "rate_hz = 500")?;
    /// scenario.validate()?;
    /// assert_eq!(scenario.period_ns(), 2_000_000);
    /// let error = Scenario::parse(path, "rate_hzz = 500").unwrap_err().to_string();
    /// assert!(error.starts_with("slow.toml:1:1: unknown field") && error.ends_with("did you mean `rate_hz`?"));
    /// # Ok::<(), masseter_shared::config::ScenarioError>(())
    /// ```
    ///
    /// # Errors
    /// [`ScenarioError::Malformed`] with line, column and key, and with the most similar key for an unknown one. An array
    /// in place of a table is refused.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ScenarioError> {
        let refused = |error| malformed(path, text, None, &error);
        let document = Document::parse(path, text).map_err(refused)?;
        let unnamed = |scenario: &Self| {
            let resolved = serde_json::to_value(scenario).expect("every part of a scenario has a JSON form");
            let (key, place) = document.unnamed_table(&resolved)?;
            let reason = format!("{key} is an array; write a table, which names its values");
            Some(ScenarioError::Malformed { place, reason })
        };
        let scenario: Self = toml::from_str(text).map_err(|error| {
            let every_table = Self { food: Some(FoodConfig::default()), ..Self::default() };
            unnamed(&every_table).unwrap_or_else(|| malformed(path, text, Some(&document), &error))
        })?;
        unnamed(&scenario).map_or(Ok(scenario), Err)
    }

    /// The scenario with every default filled in, as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("every part of a scenario has a TOML form")
    }

    /// Checks every value on its own.
    ///
    /// # Errors
    /// [`ScenarioError::BadValue`] with key, value and valid values.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        let named = self.name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
        if !named || !(1..=64).contains(&self.name.len()) {
            let need = "use 1 to 64 letters, digits, '-' or '_'";
            return Err(ScenarioError::bad("name", &format!("'{}'", self.name), need));
        }
        if !RATES_HZ.contains(&self.rate_hz) {
            let need = format!("use {} to {} Hz", RATES_HZ.start(), RATES_HZ.end());
            return Err(ScenarioError::bad("rate_hz", &self.rate_hz, need));
        }
        if let Some(duration_s) = self.duration_s {
            require_within(&[("duration_s", duration_s, SHORTEST_MOTION_S, LONGEST_S)])?;
        }
        self.realtime.validate()?;
        self.can.validate()?;
        self.drives.validate()?;
        self.dynamics.validate()?;
        for (number, fault) in self.faults.iter().enumerate() {
            let checked = fault.validate(&self.can);
            checked.map_err(|error| error.of_entry(number))?;
        }
        if let Some(food) = &self.food {
            food.validate()?;
        }
        self.limits.validate()?;
        self.controller.validate(self.rate_hz)?;
        self.checks.validate()
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

fn place_of_refusal(path: &Path, refusal: &str, key: &str, entry: Option<usize>) -> Option<String> {
    let text = read_text(path, MOST_BYTES).ok()?;
    let refused_alone = Scenario::parse(path, &text).ok()?.validate().err()?;
    let document = Document::parse(path, &text).ok()?;
    (refused_alone.to_string() == refusal).then(|| document.place_of(key, entry))
}

fn malformed(path: &Path, text: &str, document: Option<&Document>, error: &toml::de::Error) -> ScenarioError {
    let offset = error.span().map_or(0, |span| span.start);
    let mut place = place(path, text, offset);
    let mut reason = cut(error.message().lines().next().unwrap_or_default());
    if let Some(nearest) = nearest(&reason) {
        reason = format!("{reason}; did you mean `{nearest}`?");
    }
    if let Some(twice) = error.span().filter(|_| reason == "duplicate key").and_then(|span| text.get(span)) {
        reason = format!("{}: the key is there already", excerpt(twice));
    }
    let key = document.and_then(|document| {
        let key = document.key_at(offset)?;
        let culprit = document.culprit::<Scenario>(&key);
        if let Some(culprit) = &culprit {
            place = document.place_of(culprit, None);
        }
        Some(culprit.unwrap_or(key))
    });
    if let Some(key) = key.filter(|_| !reason.starts_with("unknown field")) {
        reason = format!("{}: {reason}", excerpt(&key));
    }
    ScenarioError::Malformed { place, reason }
}

/// A message of the TOML reader with every quotation cut.
fn cut(message: &str) -> String {
    let quotations = message.split_inclusive(['`', '"']).map(|part| match part.chars().next_back() {
        Some(mark @ ('`' | '"')) => excerpt(&part[..part.len() - 1]) + mark.encode_utf8(&mut [0; 4]),
        _ => excerpt(part),
    });
    quotations.collect::<String>().chars().take(LONGEST_REASON).collect()
}

/// The expected key or word most like the unknown one, both taken from serde's message.
fn nearest(message: &str) -> Option<&str> {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let is_unknown = ["unknown field", "unknown variant"].iter().any(|start| message.starts_with(start));
    let unknown = is_unknown.then(|| quoted.next())??;
    quoted.max_by(|a, b| strsim::jaro_winkler(unknown, a).total_cmp(&strsim::jaro_winkler(unknown, b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DriveConfig;

    fn parse(text: &str) -> Result<Scenario, String> {
        let scenario = Scenario::parse(Path::new("s.toml"), text).map_err(|error| error.to_string())?;
        scenario.validate().map_err(|error| error.to_string())?;
        Ok(scenario)
    }

    #[test]
    fn the_largest_seed_is_one() {
        assert_eq!(parse("seed = 18446744073709551615").unwrap().seed, u64::MAX);
    }

    #[test]
    fn an_empty_file_is_the_default_run() {
        assert_eq!(parse("").unwrap(), Scenario::default());
    }

    #[test]
    fn a_key_missing_in_a_drives_table_keeps_its_default() {
        let default = Scenario::default().drives;
        let drives = parse("[drives.slide]\nfollowing_error_m = 1").unwrap().drives;
        assert_eq!(drives.slide, DriveConfig { following_error_m: 1.0, ..default.slide });
        assert_eq!(drives.leg, default.leg);
    }

    #[test]
    fn a_resolved_scenario_reads_as_the_same_scenario() {
        let scenario = parse("name = 'x'\nduration_s = 3.0\n[motion]\nkind = 'opening'").unwrap();
        assert_eq!(parse(&scenario.to_toml()).unwrap(), scenario);
    }

    #[test]
    fn a_value_out_of_range_is_placed_in_its_file_unless_it_is_not_from_there() {
        let path = std::env::temp_dir().join(format!("masseter-placed-{}.toml", std::process::id()));
        let fault = |bus| format!("[[faults]]\nkind = 'lose'\nbus = {bus}\nfrom_s = 1.0\n");
        std::fs::write(&path, format!("seed = 1\n{}{}", fault(0), fault(2))).unwrap();
        let scenario = Scenario::read(&path).unwrap();
        let in_file = Scenario::place_refusal(scenario.validate().unwrap_err(), &path).to_string();
        let replaced = Scenario { rate_hz: 5, ..scenario };
        let elsewhere = Scenario::place_refusal(replaced.validate().unwrap_err(), &path).to_string();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(
            in_file.split_once("masseter-placed-").unwrap().1.split_once(".toml").unwrap().1,
            ":8:1: faults.bus = 2: name a bus of can.buses, from 0"
        );
        assert!(elsewhere.starts_with("rate_hz = 5"), "{elsewhere}");
    }

    #[test]
    fn long_and_strange_values_are_cut_and_escaped() {
        let long = "x".repeat(100_000);
        for text in [
            format!("rate_hz = '{long}'"),
            format!("name = '{long}'"),
            format!("{long} = 1"),
            format!("rate_hz = '{}'", "`\"".repeat(50_000)),
            format!("[motion]\nkind = '{long}'"),
            "name = \"\\u001b[2J\"".to_owned(),
            "rate_hz = \"\\u001b[2J\"".to_owned(),
            "\"\\u001b[2J\" = 1".to_owned(),
        ] {
            let error = parse(&text).unwrap_err();
            assert!(error.len() < 2500 && !error.contains('\u{1b}'), "{error}");
        }
    }

    #[test]
    fn the_masters_port_may_be_faulty_on_a_real_interface() {
        let fault = "[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 127\nfrom_s = 1.0";
        let scenario = parse(&format!("[can]\ninterfaces = ['a', 'b']\n{fault}")).unwrap();
        assert_eq!(scenario.faults[0].node, Some(127));
    }

    #[test]
    fn wrong_scenarios_are_refused_with_place_and_remedy() {
        let cases = [
            ("seed = 1\nrate_hzz = 5", "s.toml:2:1: unknown field `rate_hzz`"),
            ("seed = 1\n  rate_hz = 'fast'", "s.toml:2:13: rate_hz: invalid type"),
            ("[drives.leg]\nmax_force_n = 'much'", "s.toml:2:1: drives.leg.max_force_n: invalid type"),
            ("[motion]\nkind = 'chewing'\nvertical = 3.0", "s.toml:3:1: unknown field `vertical`"),
            ("[motion]\nvertical_mm = []\nkind = 'chewing'", "s.toml:2:1: motion.vertical_mm: invalid type"),
            ("[motion]\nkind = 'yawning'", "did you mean `opening`?"),
            ("checks = [999.0, 7]", "s.toml:1:10: checks is an array; write a table"),
            ("[drives]\nleg = [1.0]", "s.toml:2:7: drives.leg is an array; write a table"),
            ("food = [1.0, 2.0, 3.0]", "s.toml:1:8: food is an array; write a table"),
            ("seed = 1\nseed = 1", "s.toml:2:1: seed: the key is there already"),
            (
                "[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nprobability = 0.0",
                "faults.probability = 0: use more than 0",
            ),
            (
                "[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\ncount = 0",
                "faults.count = 0: use at least 1",
            ),
            (
                "[[faults]]\nkind = 'lose'\nbus = 0\nnode = 0\nfrom_s = 1.0",
                "faults.node = 0: bus 0 has the nodes 127, 1, 2, 3",
            ),
            ("[can]\nnode_ids = [1, 2, 3, 4, 5, 127]", "can.node_ids = 127: use 1 to 126, none twice"),
            ("[can]\nnode_ids = [1, 2, 3, 4, 5, 1]", "can.node_ids = 1: use 1 to 126, none twice"),
            ("[controller]\nease_s = 1e-9", "controller.ease_s = 0.000000001: use 0.1 to 86400"),
            (
                "[drives.leg]\nencoder_resolution_m = 1.0",
                "drives.leg.encoder_resolution_m = 1: use 0.000000000001 to 0.00001",
            ),
            (
                "[motion]\nkind = 'chewing'\nphases = [0.5, 0.4, 0.1]",
                "s.toml:3:10: motion.phases is an array",
            ),
            ("faults = [['lose', 1]]", "s.toml:1:"),
            ("motion = ['chewing']", "s.toml:1:"),
            ("seed = 1\nrate_hzz = 5", "did you mean `rate_hz`?"),
            ("[controller]\nease = 1.0", "did you mean `ease_s`?"),
            ("[mechanism.strokes]\nslide_m = [0, 1]\nleg = [1, 2]", "did you mean `leg_m`?"),
            ("rate_hz = 'fast'", "invalid type"),
            ("rate_hz = 1", "use 10 to 20000 Hz"),
            ("duration_s = -1.0", "duration_s = -1: use 0.1 to 86400"),
            ("duration_s = 1e-320", "use 0.1 to 86400"),
            ("duration_s = nan", "use 0.1 to 86400"),
            ("name = '../x'", "letters"),
            ("[realtime]\npriority = 0", "use 1 to 99"),
            ("[realtime]\ncores = [1, 1]", "realtime.cores = 1,1: name two"),
            ("[can]\ninterfaces = ['can0']", "can.interfaces = can0: name 2 interfaces"),
            ("[can]\ninterfaces = ['can0', 'can0']", "name 2 interfaces"),
            (
                "[drives.leg]\nrated_force_n = nan",
                "drives.leg.rated_force_n = NaN: use a finite number above 0",
            ),
            ("[drives.slide]\nencoder_noise_m = 1e300", "drives.slide.encoder_noise_m"),
            ("[dynamics]\nstep_ns = 1000000", "dynamics.step_ns = 1000000: use 10000 to 250000 ns"),
            ("[dynamics]\ngravity_m_s2 = -1.0", "dynamics.gravity_m_s2 = -1: use 0 to 100"),
            ("[dynamics]\ngravity_m_s2 = 1e5", "dynamics.gravity_m_s2 = 100000: use 0 to 100"),
            ("[dynamics]\ncarriage_mass_kg = 1e300", "dynamics.carriage_mass_kg = 1000"),
            ("[dynamics]\nrod_mass_kg = 1e-300", "dynamics.rod_mass_kg = 0.000"),
            ("[dynamics]\nleg_inertia_kg_m2 = 1e12", "dynamics.leg_inertia_kg_m2"),
            ("[dynamics]\nplatform_mass_kg = nan", "dynamics.platform_mass_kg = NaN: use 0.001 to 100"),
            (
                "[dynamics]\nplatform_inertia_kg_m2 = [1e-4, -1e-4, 1e-4]",
                "dynamics.platform_inertia_kg_m2 = -0.0001",
            ),
            ("[can]\nboot_timeout_ms = 0", "can.boot_timeout_ms = 0: use a finite number above 0"),
            ("[controller]\nease_s = 0.0", "controller.ease_s = 0: use 0.1 to"),
            ("[checks]\ntracking_rms_mm = inf", "checks.tracking_rms_mm"),
            ("[drives.leg]\nmax_force = 1.0", "did you mean `max_force_n`?"),
            ("name = ", "s.toml:1"),
            ("[can]\nideal = true\ninterfaces = ['a', 'b']", "can.ideal = true: leave it away"),
            ("[[faults]]\nkind = 'corrupt'\nbus = 2\nfrom_s = 0.0", "faults.bus = 2: name a bus"),
            ("[[faults]]\nkind = 'babble'\nbus = 0\nfrom_s = 0.0", "faults.node = none"),
            ("[[faults]]\nkind = 'delay'\nbus = 0\nfrom_s = 0.0", "faults.delay_us"),
            ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nuntil_s = 1.0", "faults.until_s = 1"),
            ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nprobability = 1.5", "faults.probability"),
            (
                "[[faults]]\nkind = 'bus_off'\nbus = 0\nnode = 1\nfrom_s = 1.0\nprobability = 0.5",
                "faults.probability = 0.5: leave it away",
            ),
            (
                "[[faults]]\nkind = 'bus_off'\nbus = 0\nnode = 1\nfrom_s = 1.0\nid = 5",
                "faults.id = 5: leave it",
            ),
            (
                "[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nfrom_s = 1.0\ncount = 2",
                "faults.count = 2: leave it away",
            ),
            ("[can]\nbitrate_bps = 2000000", "can.bitrate_bps = 2000000: bit rate 2000000"),
            ("[can]\nheartbeat_producer_ms = 0", "can.heartbeat_producer_ms = 0: use at least 1 ms"),
            (
                "[controller]\nhold_s = 1e9",
                "controller.hold_s = 1000000000: use more than 0 and at most 86400 s",
            ),
            (
                "[limits]\nleg_velocity_m_s = nan",
                "limits.leg_velocity_m_s = NaN: use a finite number above 0",
            ),
            ("[limits]\nmax_condition = -1.0", "limits.max_condition = -1: use a finite number above 0"),
            ("[food]\npoint_m = [0.0, 1e150, 0.0]", "food.point_m"),
            ("[food]\nstiffness_n_per_m = 0.0", "food.stiffness_n_per_m = 0: use 1 to 1000000"),
            ("[food]\nthickness_mm = 10.0", "did you mean `thickness_m`?"),
            (
                "[[faults]]\nkind = 'melt'\nbus = 0\nfrom_s = 1.0",
                "s.toml:2:8: faults.kind: unknown variant `melt`",
            ),
            (
                "[can]\ninterfaces = ['a', 'b']\n[[faults]]\nkind = 'corrupt'\nbus = 0\nfrom_s = 1.0",
                "faults.kind = corrupt: leave it away with can.interfaces",
            ),
            (
                "[can]\ninterfaces = ['a', 'b']\n[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nfrom_s = 1.0",
                "faults.node = 1: on a real interface only the master (node 127)",
            ),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err();
            assert!(error.contains(expected), "{text:?} gave {error:?}");
        }
    }
}
