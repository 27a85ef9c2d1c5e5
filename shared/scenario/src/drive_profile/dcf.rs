//! Device configuration files (CiA 306) of a profile: what the rig takes from them, what it cannot take, and for which node
//! and bit rate they are.

use std::{collections::BTreeMap, path::Path};

use masseter_can::canopen::ObjectAddress;
use masseter_can::canopen::dcf::{Dcf, Entry, Value};
use masseter_model::geometry::AXIS_NAMES;

use super::object::{OF_NODE, ObjectConfig, ObjectKey, ObjectRule};
use crate::can::{CanConfig, MASTER_NODE};
use crate::error::{Checked, ScenarioError, require};
use crate::input::read_foreign_text;
use crate::wording::{counted, listed};

/// Size of the largest file, bytes.
const MOST_BYTES: u64 = 4 << 20;
/// Objects that the rig never takes from a file, with the reason.
const OWN: [(std::ops::Range<u16>, &str); 7] = [
    (0x1010..0x1012, "a command"),
    (0x1018..0x1019, "drive_profile.identity decides"),
    (0x1400..0x1C00, "PDO layout is the rig's"),
    (0x6040..0x6041, "a command"),
    (0x6060..0x6061, "the rig decides the mode"),
    (0x607A..0x607B, "the rig decides the target"),
    (0x607C..0x607D, HOME),
];
const HOME: &str = "drive_profile.homing decides";
/// The event timer of the RPDO, which a file may limit.
const EVENT_TIMER: ObjectAddress = ObjectAddress::new(0x1400, 5);
/// Objects of the master's table that drives may lack: a file without one of them makes it absent.
const MAY_LACK: [ObjectAddress; 7] = [
    EVENT_TIMER,
    ObjectAddress::new(0x6007, 0),
    ObjectAddress::new(0x605A, 0),
    ObjectAddress::new(0x6065, 0),
    ObjectAddress::new(0x6066, 0),
    ObjectAddress::new(0x607C, 0),
    ObjectAddress::new(0x6085, 0),
];

section! {
    /// What the file of `dcf` says beside `objects`; the rig writes this table into the resolved scenario.
    pub struct DcfRead {
        /// Name of the file.
        pub file: String = String::new(),
        /// The node that the file is for.
        pub node_id: Option<u16> = None => "the node id of each of `axes`",
        /// The bit rate that the file is for.
        pub bitrate_bps: Option<u32> = None => "`can.bitrate_bps`",
        /// Objects with a value or a limit that the rig does not take over, by the reason.
        pub not_taken: BTreeMap<String, Vec<ObjectKey>> = BTreeMap::new(),
    }
}

impl DcfRead {
    /// Reads a file, and adds its objects to those of a profile with that home object.
    pub(super) fn of_file(
        path: &Path,
        home: ObjectKey,
        objects: &mut BTreeMap<ObjectKey, ObjectConfig>,
    ) -> Result<Self, ScenarioError> {
        let unreadable = |error| ScenarioError::Unreadable { path: path.to_owned(), error };
        let text = read_foreign_text(path, MOST_BYTES).map_err(unreadable)?;
        let dcf = Dcf::parse(&text).map_err(|error| ScenarioError::Malformed {
            place: format!("{}:{}", path.display(), error.line),
            reason: error.problem,
        })?;
        if dcf.entries().len() == 0 {
            let reason = "it describes no object; name the EDS or DCF of the drive".to_owned();
            return Err(ScenarioError::Malformed { place: path.display().to_string(), reason });
        }
        let mut read = Self {
            file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            node_id: dcf.commissioning.node_id,
            bitrate_bps: dcf.commissioning.baudrate_kbit_s.map(|kbit_s| u32::from(kbit_s) * 1000),
            not_taken: BTreeMap::new(),
        };
        read.add(&dcf, home, objects);
        Ok(read)
    }

    /// Adds the objects of a file. Those that the profile names itself stay as they are.
    fn add(&mut self, dcf: &Dcf, home: ObjectKey, objects: &mut BTreeMap<ObjectKey, ObjectConfig>) {
        let is_absent = |address: &ObjectAddress| {
            dcf.entry(*address).is_none() && !dcf.undescribed.contains(&address.index)
        };
        let absent = MAY_LACK.into_iter().filter(is_absent);
        for address in absent {
            let absent = ObjectConfig { rule: ObjectRule::Absent, ..Default::default() };
            objects.entry(ObjectKey(address)).or_insert(absent);
        }
        let beside = [
            (&dcf.undescribed, "listed without a section; is the file cut short?"),
            (&dcf.of_modules, "of a module"),
        ];
        for (indices, reason) in beside.into_iter().filter(|(indices, _)| !indices.is_empty()) {
            let keys = indices.iter().map(|index| ObjectKey(ObjectAddress::new(*index, 0)));
            self.not_taken.insert(reason.to_owned(), keys.collect());
        }
        for entry in dcf.entries() {
            let key = ObjectKey(entry.address);
            let (object, mut reason) = object_of(entry, (key == home).then_some(HOME));
            if let Some(object) = object {
                let kept = *objects.entry(key).or_insert(object);
                let is_lost = |of_file: Option<i64>, kept| of_file.is_some() && of_file != kept;
                let is_other = object.value.is_some() && object.plus_node_id != kept.plus_node_id;
                if is_other
                    || is_lost(object.value, kept.value)
                    || is_lost(object.lowest, kept.lowest)
                    || is_lost(object.highest, kept.highest)
                {
                    reason = Some("the profile names the object".to_owned());
                }
            }
            if let Some(reason) = reason {
                self.not_taken.entry(reason).or_default().push(key);
            }
        }
    }

    /// What the rig does not take from the file, in one line; `None` if it takes everything.
    pub(super) fn warning(&self) -> Option<String> {
        let count = self.not_taken.values().map(Vec::len).sum::<usize>();
        let group = |(reason, keys): (&String, &Vec<ObjectKey>)| format!("{} ({reason})", listed(keys));
        let groups = self.not_taken.iter().map(group).collect::<Vec<_>>().join("; ");
        let count = counted(count as u64, "object");
        (!groups.is_empty()).then(|| format!("not taken from the file {}: {count}: {groups}", self.file))
    }

    /// Refuses a file that is for another node than those of the axes, or for another bit rate.
    pub(super) fn validate(&self, axes: &[String], can: &CanConfig) -> Checked {
        let need = |key, number: u32| {
            let remedy = "use the file of this drive, or correct one of the two";
            format!("{} is for another drive: [DeviceComissioning] has {key}={number}; {remedy}", self.file)
        };
        for (name, node) in AXIS_NAMES.iter().zip(can.node_ids) {
            let of_file = self.node_id.filter(|_| axes.iter().any(|axis| axis == name));
            let of_file = of_file.unwrap_or(node.into());
            let value = format_args!("{node} (axis {name})");
            require(of_file == u16::from(node), "can.node_ids", &value, need("NodeID", of_file.into()))?;
        }
        let bitrate_bps = self.bitrate_bps.unwrap_or(can.bitrate_bps);
        let need = need("Baudrate", bitrate_bps / 1000);
        require(bitrate_bps == can.bitrate_bps, "can.bitrate_bps", &can.bitrate_bps, need)
    }
}

/// What a file says of an entry, as far as the master can use that, and why the master cannot use the rest. With `decided`,
/// something else decides the object.
fn object_of(entry: &Entry, decided: Option<&str>) -> (Option<ObjectConfig>, Option<String>) {
    let Entry { address, data_type, access, lowest, highest, .. } = entry;
    // A value that nobody can change is compared, where the master would write it.
    let is_fixed = !access.is_writable();
    let fixed = entry.value().filter(|_| is_fixed && *address == ObjectAddress::new(0x60C2, 2));
    let value = entry.parameter.as_ref().or(fixed);
    if [value, lowest.as_ref(), highest.as_ref()].iter().all(Option::is_none) {
        return (None, None);
    }
    let own = OWN.iter().find(|(range, _)| range.contains(&address.index)).map(|(_, reason)| *reason);
    let is_limited_alone = *address == EVENT_TIMER && value.is_none();
    if let Some(reason) = decided.or(own).filter(|_| !is_limited_alone) {
        return (None, Some(reason.to_owned()));
    }
    let Some(bits) = data_type.bits().filter(|bits| *bits <= u32::BITS && !data_type.is_real()) else {
        return (None, Some(data_type.to_string()));
    };
    if !access.is_readable() {
        return (None, Some("write-only: nothing would prove the write".to_owned()));
    }
    let (value, mut reason) = match value.map(|value| carried(value, *address, bits)).transpose() {
        Ok(value) => (value, None),
        Err(reason) => (None, Some(reason.to_owned())),
    };
    let [lowest, highest] = [lowest, highest].map(|limit| match limit {
        Some(Value::Number(number)) => i64::try_from(*number).ok(),
        Some(_) => {
            reason.get_or_insert_with(|| "a limit of $NODEID".to_owned());
            None
        }
        None => None,
    });
    let rule = if *address == EVENT_TIMER {
        ObjectRule::Optional
    } else if is_fixed {
        ObjectRule::Expect
    } else {
        ObjectRule::Write
    };
    let (value, plus_node_id) = value.map_or((None, false), |(value, plus)| (Some(value), plus));
    let bytes = Some((bits / 8) as u8);
    let object = ObjectConfig { rule, value, lowest, highest, bytes, plus_node_id };
    let says_something = [value, lowest, highest].iter().any(Option::is_some);
    (says_something.then_some(object), reason)
}

/// A value as a profile carries it, and whether the node id is added to it; else the reason why no profile does.
fn carried(value: &Value, address: ObjectAddress, bits: u32) -> Result<(i64, bool), &'static str> {
    let bases = 0..(1 << bits) - i128::from(MASTER_NODE.get());
    match value {
        Value::Number(number) => Ok((*number as i64, false)),
        Value::OfNode(_) if !OF_NODE.contains(&address.index) => {
            Err("$NODEID in no object of the communication")
        }
        Value::OfNode(base) if !bases.contains(base) => Err("$NODEID beyond the data type"),
        Value::OfNode(base) => Ok((*base as i64, true)),
        Value::Real(_) | Value::Text(_) => Err("no integer"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    fn home() -> ObjectKey {
        "607Ch".parse().unwrap()
    }

    const FILE: &str = "
[1017]\nParameterName=Heartbeat\nDataType=0x6\nAccessType=rw\nDefaultValue=0\n
[6007]\nParameterName=Abort\nDataType=0x3\nAccessType=rw\nParameterValue=2\n
[6065]\nParameterName=Window\nDataType=0x7\nAccessType=rw\nParameterValue=1500\nLowLimit=1\nHighLimit=9000\n
[6066]\nParameterName=Time\nDataType=0x6\nAccessType=rw\nLowLimit=0\nHighLimit=0\n
[60C2]\nParameterName=Period\nObjectType=0x9\nSubNumber=3\n
[60C2sub0]\nParameterName=Highest\nDataType=0x5\nAccessType=const\nDefaultValue=2\n
[60C2sub1]\nParameterName=Value\nDataType=0x5\nAccessType=rw\nHighLimit=100\n
[60C2sub2]\nParameterName=Exponent\nDataType=0x2\nAccessType=ro\nDefaultValue=-3\n
[1800]\nParameterName=PDO\nObjectType=0x9\nSubNumber=2\n
[1800sub0]\nParameterName=Highest\nDataType=0x5\nAccessType=const\nDefaultValue=2\n
[1800sub1]\nParameterName=COB-ID\nDataType=0x7\nAccessType=rw\nParameterValue=$NODEID+0x180\n
";

    #[test]
    fn a_file_gives_values_limits_and_what_the_drive_lacks() {
        let (mut objects, mut read) = (BTreeMap::new(), DcfRead::default());
        read.add(&Dcf::parse(FILE).unwrap(), home(), &mut objects);
        let object = |key: &str| objects.get(&key.parse().unwrap()).copied();
        let window = ObjectConfig {
            rule: ObjectRule::Write,
            value: Some(1500),
            lowest: Some(1),
            highest: Some(9000),
            bytes: Some(4),
            plus_node_id: false,
        };
        assert_eq!(object("6065h"), Some(window));
        let fixed = object("60C2h:02").unwrap();
        assert_eq!((fixed.rule, fixed.value), (ObjectRule::Expect, Some(-3)));
        let time = object("6066h").unwrap();
        assert_eq!((time.value, time.highest), (None, Some(0)));
        for lacking in ["605Ah", "607Ch", "6085h"] {
            assert_eq!(object(lacking).unwrap().rule, ObjectRule::Absent, "{lacking}");
        }
        assert_eq!((object("1800h:01"), object("1017h")), (None, None), "the rig's own, and nothing said");
        assert_eq!(
            read.warning().unwrap(),
            "not taken from the file : 1 object: 1800h:01 (PDO layout is the rig's)"
        );
    }

    /// Objects and warning of a file with these lines, beside those of a profile.
    fn read(lines: &[(&str, &str)], own: &str) -> (BTreeMap<ObjectKey, ObjectConfig>, String) {
        let section = |(name, lines): &(&str, &str)| {
            let access = if lines.contains("AccessType") { "" } else { "AccessType=rw\n" };
            format!("[{name}]\nParameterName=X\n{access}{}\n", lines.replace(' ', "\n"))
        };
        let text: String = lines.iter().map(section).collect();
        let mut read = DcfRead { file: "x.dcf".to_owned(), ..DcfRead::default() };
        let mut objects = toml::from_str(own).unwrap();
        read.add(&Dcf::parse(&text).unwrap(), home(), &mut objects);
        (objects, read.warning().unwrap_or_default())
    }

    #[test]
    fn an_object_that_the_file_lists_without_a_section_is_not_taken_for_absent() {
        let (objects, warning) = read(&[("2000", "DataType=7 [OptionalObjects] 1=0x6065")], "");
        let is_absent = |key: &str| objects.contains_key(&key.parse().unwrap());
        assert_eq!([is_absent("6065h"), is_absent("6066h")], [false, true]);
        assert!(warning.ends_with("6065h (listed without a section; is the file cut short?)"), "{warning}");
    }

    #[test]
    fn what_a_profile_cannot_carry_is_counted_and_named() {
        let lines = [
            ("1010", "ObjectType=9"),
            ("1010sub1", "DataType=7 ParameterValue=5 AccessType=wo"),
            ("1012", "DataType=7 ParameterValue=$NODEID+0x80"),
            ("1014", "DataType=5 ParameterValue=$NODEID+0x90"),
            ("1015", "DataType=6 ParameterValue=5 HighLimit=$NODEID"),
            ("1018", "ObjectType=9"),
            ("1018sub1", "DataType=7 ParameterValue=5 AccessType=ro"),
            ("1400", "ObjectType=9"),
            ("1400sub1", "DataType=7 ParameterValue=$NODEID+0x200"),
            ("1400sub2", "DataType=5 ParameterValue=1"),
            ("1800", "ObjectType=9"),
            ("1800sub5", "DataType=6 HighLimit=9"),
            ("1bff", "DataType=5 ParameterValue=1"),
            ("1c00", "DataType=5 ParameterValue=1"),
            ("2014", "DataType=8 DefaultValue=1.5 ParameterValue=1.5"),
            ("2015", "DataType=9 ParameterValue=hello"),
            ("2016", "DataType=0x1B ParameterValue=5"),
            ("2017", "DataType=0x11 HighLimit=1e9"),
            ("2018", "DataType=0x15 ParameterValue=-5"),
            ("2019", "DataType=0xA ParameterValue=00"),
            ("201A", "DataType=7 ParameterValue=$NODEID"),
            ("201B", "DataType=0x1B DefaultValue=5"),
            ("201C", "DataType=0x8000 ParameterValue=5"),
            ("2021", "DataType=7 ParameterValue=5 AccessType=wo"),
            ("6040", "DataType=6 ParameterValue=15"),
            ("6065", "DataType=7 ParameterValue=5"),
            ("6066", "DataType=6 ParameterValue=5"),
            ("6067", "DataType=7 HighLimit=5"),
            ("607C", "DataType=4 ParameterValue=5000"),
            ("M1Fixed6423", "DataType=1 ParameterValue=1"),
        ];
        let own =
            "1012h = { value = 128 }\n6065h = { value = 7 }\n6066h = { value = 5 }\n6067h = { value = 3 }";
        let (objects, warning) = read(&lines, own);
        let taken = |key: &str| objects.get(&key.parse().unwrap()).and_then(|object| object.value);
        let own = ["1015h", "1C00h", "6065h", "6066h", "1018h:01", "2014h"].map(taken);
        assert_eq!(own, [Some(5), Some(1), Some(7), Some(5), None, None]);
        for named in [
            "not taken from the file x.dcf: 23 objects: ",
            "1010h:01, 6040h (a command)",
            "2021h (write-only",
            "607Ch (drive_profile.homing decides)",
            "1014h ($NODEID beyond the data type)",
            "1015h (a limit of $NODEID)",
            "1018h:01 (drive_profile.identity decides)",
            "1400h:01, 1400h:02, 1800h:05, 1BFFh (PDO layout is the rig's)",
            "2014h (REAL32)",
            "2015h (VISIBLE_STRING)",
            "2016h (UNSIGNED64)",
            "2017h (REAL64)",
            "2018h (INTEGER64)",
            "2019h (OCTET_STRING)",
            "201Ah ($NODEID in no object of the communication)",
            "201Ch (data type 8000h)",
            "6423h (of a module)",
            "1012h, 6065h, 6067h (the profile names the object)",
        ] {
            assert!(warning.contains(named), "{named}: {warning}");
        }
    }

    #[test]
    fn integers_of_up_to_32_bits_and_values_of_the_node_are_taken() {
        let lines = [
            ("1014", "DataType=7 DefaultValue=1 ParameterValue=$NODEID+0x80 LowLimit=1"),
            ("2000", "DataType=0x10 ParameterValue=-5 LowLimit=-8388608"),
            ("2001", "DataType=0x16 ParameterValue=0xFFFFFF"),
            ("2002", "DataType=1 ParameterValue=1"),
            ("2003", "DataType=7 ParameterValue=0xFFFFFFFF"),
            ("2004", "ObjectType=8 DataType=3 CompactSubObj=2 ParameterValue=4"),
            ("2004Value", "NrOfEntries=1 2=-7"),
        ];
        let (objects, warning) = read(&lines, "");
        assert_eq!(warning, "");
        let object = |key: &str| objects[&key.parse().unwrap()];
        let [cob_id, small, large, flag, whole, one, two] =
            ["1014h", "2000h", "2001h", "2002h", "2003h", "2004h:01", "2004h:02"].map(object);
        assert_eq!(
            (cob_id.value, cob_id.plus_node_id, cob_id.at_node(5).value),
            (Some(0x80), true, Some(0x85))
        );
        assert_eq!((small.value, small.bytes, small.at_node(5).value), (Some(-5), Some(3), Some(-5)));
        assert_eq!((large.value, large.bytes), (Some(0xFF_FFFF), Some(3)));
        assert_eq!((flag.bytes, whole.value), (Some(1), Some(0xFFFF_FFFF)));
        assert_eq!([one.value, two.value], [Some(4), Some(-7)], "a compact array");
        for (key, object) in objects {
            object.validate(key).unwrap();
        }
    }

    #[test]
    fn objects_of_the_profile_stay_and_a_bad_file_is_refused_with_its_line() {
        let path = std::env::temp_dir().join(format!("masseter-{}.dcf", std::process::id()));
        std::fs::write(&path, FILE).unwrap();
        let own = ObjectConfig { value: Some(7), ..ObjectConfig::default() };
        let mut objects = BTreeMap::from([("6065h".parse().unwrap(), own)]);
        DcfRead::of_file(&path, home(), &mut objects).unwrap();
        assert_eq!((objects[&"6065h".parse().unwrap()], objects.len() > 5), (own, true));
        std::fs::write(&path, "[6065]\nParameterName=W\nDataType=seven\n").unwrap();
        let error = DcfRead::of_file(&path, home(), &mut objects).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert!(error.contains(".dcf:3: "), "{error}");
        assert!(DcfRead::of_file(&path, home(), &mut objects).is_err(), "a file that is not there");
    }

    #[test]
    fn a_file_for_another_node_or_bit_rate_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.toml");
        let refusal = |profile: &str, section: &str, changed: &str| {
            let text = [section, FILE, "\n; Pr\u{fc}fung"].concat();
            let latin_1: Vec<u8> = text.chars().map(|c| c as u8).collect();
            std::fs::write(folder.path().join("l1.dcf"), latin_1).unwrap();
            let tables = format!("{profile}\n[[drive_profile]]\naxes = ['l1']\ndcf = 'l1.dcf'");
            std::fs::write(&path, tables).unwrap();
            let mut scenario = Scenario::read(&path).unwrap();
            if !changed.is_empty() {
                scenario = scenario.with(changed).unwrap();
            }
            scenario.validate().err().map_or_else(String::new, |error| error.to_string())
        };
        let node = "[DeviceComissioning]\nNodeID=0x09\nBaudrate=1000\n";
        let refused = "can.node_ids = 4 (axis l1): l1.dcf is for another drive: [DeviceComissioning] has NodeID=9; use the";
        assert!(refusal("", node, "").starts_with(refused), "{}", refusal("", node, ""));
        assert_eq!(refusal("can.node_ids = [1, 2, 3, 9, 5, 6]", node, ""), "");
        assert_eq!(refusal("", node, "can.node_ids = [1, 2, 3, 9, 5, 6]"), "", "what the run has counts");
        assert!(refusal("can.node_ids = [9, 2, 3, 4, 5, 6]", node, "").starts_with(refused));
        let rate = "[devicecommissioning]\nBaudrate=500\nNodeID=4\n";
        let refused = "can.bitrate_bps = 1000000: l1.dcf is for another drive: [DeviceComissioning] has Baudrate=500; use";
        assert!(refusal("", rate, "").starts_with(refused), "{}", refusal("", rate, ""));
        assert_eq!(refusal("can.bitrate_bps = 500000", rate, ""), "");
        let none = "[DeviceComissioning]\nNodeID=0\nBaudrate=\nNodeName=x\n";
        assert_eq!(refusal("", none, ""), "", "0 and nothing name none");
    }
}
