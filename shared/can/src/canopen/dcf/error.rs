//! What makes a text no device description.

/// A line that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct DcfError {
    /// Number of the line, from 1.
    pub line: usize,
    /// What is wrong there.
    pub problem: Problem,
}

/// What is wrong in a line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// Neither a section, nor a key with a value, nor a comment.
    #[error("{text:?} is neither [section] nor key=value; start a comment with a semicolon")]
    NoEntry {
        /// The line.
        text: String,
    },
    /// A value before the first section.
    #[error("{key} stands before the first [section]")]
    OutsideSections {
        /// The key.
        key: String,
    },
    /// A section that occurred before.
    #[error("[{section}] occurs twice, first in line {first}; remove one of them")]
    SecondSection {
        /// Name of the section.
        section: String,
        /// Line of the first one.
        first: usize,
    },
    /// A key that occurred in its section before.
    #[error("{key} occurs twice in its section, first in line {first}; remove one of them")]
    SecondKey {
        /// The key.
        key: String,
        /// Line of the first one.
        first: usize,
    },
    /// A section without a key that it needs.
    #[error("[{section}] has no {key}; add it")]
    Missing {
        /// Name of the section.
        section: String,
        /// The key.
        key: &'static str,
    },
    /// A sub-index whose object has no section.
    #[error("[{index:04X}sub{subindex:X}] has no section [{index:04X}] of its object; add it")]
    NoObject {
        /// Index of the object.
        index: u16,
        /// The sub-index.
        subindex: u8,
    },
    /// No number of CiA 306.
    #[error("{key}={text} is no number; write decimal, 0x hexadecimal, 0 octal or $NODEID+number")]
    NoNumber {
        /// The key.
        key: String,
        /// The value.
        text: String,
    },
    /// A number that its place or its data type cannot hold.
    #[error("{key}={text} is not within {lowest} to {highest}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The value.
        text: String,
        /// The lowest number.
        lowest: i128,
        /// The highest number.
        highest: i128,
    },
    /// An access type that CiA 306 does not define.
    #[error("AccessType={text} is none of ro, wo, rw, rwr, rww, const")]
    UnknownAccess {
        /// The value.
        text: String,
    },
    /// An object type without entries that could be read.
    #[error("ObjectType={code:#X} is none of 2 (domain), 5, 6, 7 (variable), 8 (array), 9 (record)")]
    UnknownObjectType {
        /// The number.
        code: u8,
    },
}

impl Problem {
    /// The problem in that line.
    pub(super) const fn at(self, line: usize) -> DcfError {
        DcfError { line, problem: self }
    }
}
