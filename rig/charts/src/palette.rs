//! Colours of plots that colour-blind people can tell apart (Okabe and Ito).

use plotters::style::RGBColor;

/// Blue.
pub const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
/// Vermilion.
pub const VERMILION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
/// Green.
pub const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
/// Purple.
pub const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
/// Orange.
pub const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
/// Sky.
pub const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
