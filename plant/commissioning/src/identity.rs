//! The identity of an axis' drive: its identity object (1018h) and its node id. A step compares the identities at its
//! beginning and its end.

use std::fmt::{self, Display, Formatter};

use masseter_can::canopen::ObjectAddress;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::{sdo::SdoReason, wanted::WantedDrive};
use masseter_scenario::CanConfig;
use serde::{Deserialize, Serialize};

use crate::line::{BootUps, Line};
use crate::line_error::{LineError, OtherMaster, Restarted};
use crate::object_words::{object_name, value_text};
use crate::settings::Survey;

/// The identity object.
const INDEX: u16 = 0x1018;
const SERIAL: u8 = 4;
/// Drives with unknown identities.
pub const NOT_ASKED: [Known; AXES] = [Known::NotAsked; AXES];

/// One entry of the identity object. All entries but the first are optional (CiA 301, 7.5.2.19).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Entry {
    /// The drive has this number.
    Told(u32),
    /// The drive refuses the request, and so has no such number.
    Absent,
}

/// The identity of a drive. Two drives without serial numbers may have equal ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// The node id of its answers.
    pub node: u8,
    /// 1018h:01h.
    pub vendor: Entry,
    /// 1018h:02h.
    pub product: Entry,
    /// 1018h:03h.
    pub revision: Entry,
    /// 1018h:04h.
    pub serial: Entry,
}

/// The known identity of the drive of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Known {
    /// The drive has not been asked, or gives no answer.
    NotAsked,
    /// The identity.
    Is(Identity),
}

/// A drive of another identity than the profile's.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: object {object} ({}) is {}, the profile wants {}; enter this drive's identity in \
     drive_profile.identity, or use the drive that the profile is for",
    AXIS_NAMES[*axis], object_name(*object), .found.in_words(object.subindex), value_text(*object, *wanted)
)]
pub struct OtherKind {
    axis: usize,
    object: ObjectAddress,
    found: Entry,
    wanted: u32,
}

impl Entry {
    /// In words: a serial number as on the type plate.
    fn in_words(self, subindex: u8) -> String {
        match self {
            Self::Told(number) if subindex == SERIAL => number.to_string(),
            Self::Told(number) => format!("{number:X}h"),
            Self::Absent => "none".to_owned(),
        }
    }
}

impl Identity {
    /// Asks a drive.
    ///
    /// # Errors
    /// [`LineError`], also for a silent drive, which may be any drive.
    pub fn read(line: &mut Line, can: &CanConfig, axis: usize) -> Result<Self, LineError> {
        Self::of(can.node_ids[axis], |object| {
            Ok(line.read_if_there(axis, object)?.map_or(Entry::Absent, Entry::Told))
        })
    }

    /// Asks all drives.
    ///
    /// # Errors
    /// Those of [`Self::read`], for the first drive that does not answer.
    pub fn read_all(line: &mut Line, can: &CanConfig) -> Result<[Self; AXES], LineError> {
        let all = (0..AXES).map(|axis| Self::read(line, can, axis)).collect::<Result<Vec<_>, _>>()?;
        Ok(all.try_into().expect("one for each axis"))
    }

    fn of<E>(node: u8, mut entry: impl FnMut(ObjectAddress) -> Result<Entry, E>) -> Result<Self, E> {
        let mut of = |subindex| entry(ObjectAddress::new(INDEX, subindex));
        Ok(Self { node, vendor: of(1)?, product: of(2)?, revision: of(3)?, serial: of(SERIAL)? })
    }

    /// Its entries with their sub-indices and names.
    fn entries(&self) -> [(u8, &'static str, Entry); 4] {
        [
            (1, "vendor", self.vendor),
            (2, "product code", self.product),
            (3, "revision", self.revision),
            (SERIAL, "serial number", self.serial),
        ]
    }

    /// Refuses a drive of another vendor, product or revision than the profile's.
    ///
    /// # Errors
    /// [`OtherKind`].
    pub fn check_kind(&self, axis: usize, wanted: &WantedDrive) -> Result<(), OtherKind> {
        for (subindex, _, found) in self.entries() {
            let object = ObjectAddress::new(INDEX, subindex);
            let Some(entry) = wanted.identity.iter().find(|entry| entry.object == object) else { continue };
            let is_right = match found {
                Entry::Told(number) => number & entry.mask == entry.value & entry.mask,
                Entry::Absent => entry.mask == 0,
            };
            if !is_right {
                return Err(OtherKind { axis, object, found, wanted: entry.value });
            }
        }
        Ok(())
    }

    /// Its differences from an earlier identity, such as "product code was 402h, and is 7h".
    pub fn differs_from(&self, before: &Self) -> String {
        let entries = before.entries().into_iter().zip(self.entries());
        let others = entries.filter(|((.., before), (.., now))| before != now);
        let others = others.map(|((part, name, before), (.., now))| {
            format!("{name} was {}, and is {}", before.in_words(part), now.in_words(part))
        });
        let node = format!("node was {}, and is {}", before.node, self.node);
        others.chain((before.node != self.node).then_some(node)).collect::<Vec<_>>().join("; ")
    }
}

impl Display for Identity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "node {}", self.node)?;
        let mut entries = self.entries().into_iter();
        entries.try_for_each(|(part, name, entry)| write!(f, ", {name} {}", entry.in_words(part)))
    }
}

impl Known {
    /// The identity in a survey; `NotAsked` unless all answers came.
    pub fn of_survey(survey: Option<&Survey>, node: u8) -> Self {
        let Some(survey) = survey.filter(|survey| !survey.fell_silent()) else { return Self::NotAsked };
        // Only a refusal shows that the drive has no such entry.
        let entry = |object| match (survey.number(object), survey.refusal(object)) {
            (Some(number), _) => Ok(Entry::Told(number)),
            (None, Some(SdoReason::Aborted(_))) => Ok(Entry::Absent),
            (None, _) => Err(()),
        };
        Identity::of(node, entry).map_or(Self::NotAsked, Self::Is)
    }

    /// The identity, if it is known.
    pub const fn identity(&self) -> Option<&Identity> {
        if let Self::Is(identity) = self { Some(identity) } else { None }
    }
}

/// The reason why a step's reads and writes of a drive may be void.
#[derive(Debug, thiserror::Error)]
pub enum Disturbance {
    /// The drive has restarted.
    #[error(transparent)]
    Restarted(#[from] Restarted),
    /// Another master may have changed the drive.
    #[error(transparent)]
    OtherMaster(#[from] OtherMaster),
    /// The drive no longer answers.
    #[error(transparent)]
    Line(#[from] LineError),
    /// Another drive answers.
    #[error(
        "{}: the drive's {}; leave the drives in their places during a step",
        AXIS_NAMES[*axis], .now.differs_from(before)
    )]
    OtherDrive {
        /// The axis.
        axis: usize,
        /// The drive at the beginning of the step.
        before: Identity,
        /// The present drive.
        now: Identity,
    },
}

/// Refuses drives after a restart since then, or beside a sign of another master. Sends nothing.
pub fn check_undisturbed(line: &Line, axes: &[usize], since: BootUps) -> Result<(), Disturbance> {
    axes.iter().try_for_each(|&axis| since.check_axis(line, axis))?;
    Ok(line.strangers().refuse_masters()?)
}

/// Makes these checks, and reads the identities of the drives again.
pub fn check_present(
    line: &mut Line,
    can: &CanConfig,
    axes: &[usize],
    since: BootUps,
    drives: &[Known; AXES],
) -> Result<(), Disturbance> {
    let answers: Vec<_> = axes.iter().map(|&axis| (axis, Identity::read(line, can, axis))).collect();
    // A restart is the cause of a missing answer, and may become known during the wait for the answer.
    check_undisturbed(line, axes, since)?;
    for (axis, now) in answers {
        let now = now?;
        if let Known::Is(before) = drives[axis]
            && before != now
        {
            return Err(Disturbance::OtherDrive { axis, before, now });
        }
    }
    Ok(())
}

/// The gaps of these identities, one line each.
pub fn gaps(drives: &[Known; AXES]) -> Vec<String> {
    let known = || drives.iter().enumerate().filter_map(|(axis, known)| Some((axis, known.identity()?)));
    let names = |alike: &dyn Fn(&Identity) -> bool| {
        let alike = known().filter(|(_, identity)| alike(identity));
        alike.map(|(axis, _)| AXIS_NAMES[axis]).collect::<Vec<_>>()
    };
    let mut gaps = Vec::new();
    let without = names(&|identity| identity.serial == Entry::Absent);
    if !without.is_empty() {
        gaps.push(format!(
            "{}: no serial number (1018h:04), so that nobody knows whether a drive of the same vendor, product \
             and revision has taken its place",
            without.join(" ")
        ));
    }
    for (axis, identity) in known().filter(|(_, identity)| identity.serial != Entry::Absent) {
        // Two nodes may have the same numbers.
        let twins = names(&|other| other.entries() == identity.entries());
        if twins.len() > 1 && twins[0] == AXIS_NAMES[axis] {
            gaps.push(format!(
                "{}: one identity, serial number {}: nobody knows which is which when they change places",
                twins.join(" "),
                identity.serial.in_words(SERIAL)
            ));
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive of the rig's kind at a node.
    fn drive(node: u8, serial: Entry) -> Identity {
        let [vendor, product, revision] = [0x004D_5354, 0x402, 0x1_0000].map(Entry::Told);
        Identity { node, vendor, product, revision, serial }
    }

    /// Six drives with these serial numbers.
    fn drives(serials: [Entry; AXES]) -> [Known; AXES] {
        std::array::from_fn(|axis| Known::Is(drive(axis as u8 + 1, serials[axis])))
    }

    #[test]
    fn what_identities_do_not_tell_is_said_in_one_line_for_each_gap() {
        let told = [1, 2, 3, 4, 5, 6].map(Entry::Told);
        assert_eq!(gaps(&drives(told)), [""; 0]);
        assert_eq!(gaps(&NOT_ASKED), [""; 0], "who is not asked has not refused to tell");
        let mut serials = told;
        (serials[1], serials[3], serials[5]) = (Entry::Absent, Entry::Told(5), Entry::Absent);
        let [without, twins] = &gaps(&drives(serials))[..] else { panic!("{:?}", gaps(&drives(serials))) };
        assert!(without.starts_with("d2 l3: no serial number (1018h:04)"), "{without}");
        assert!(twins.starts_with("l1 l2: one identity, serial number 5:"), "{twins}");
    }

    #[test]
    fn every_part_of_an_identity_counts() {
        let before = drive(4, Entry::Told(7));
        assert_eq!(drive(4, Entry::Absent).differs_from(&before), "serial number was 7, and is none");
        let product = Entry::Told(9);
        assert_eq!(Identity { product, ..before }.differs_from(&before), "product code was 402h, and is 9h");
        assert_eq!(Identity { node: 5, ..before }.differs_from(&before), "node was 4, and is 5");
    }
}
