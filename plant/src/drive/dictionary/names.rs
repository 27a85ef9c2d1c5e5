//! The entries that the drive itself reads and writes, by name.

use super::objects::{Slot, slot};

pub(crate) const ERROR_REGISTER: Slot<u8> = slot(0x1001, 0);
pub(crate) const ERROR_COUNT: Slot<u8> = slot(0x1003, 0);
pub(crate) const NEWEST_ERROR: Slot<u32> = slot(0x1003, 1);
pub(crate) const EMERGENCY_COB_ID: Slot<u32> = slot(0x1014, 0);
pub(crate) const CONSUMER_HEARTBEAT_TIME: Slot<u32> = slot(0x1016, 1);
pub(crate) const PRODUCER_HEARTBEAT_TIME_MS: Slot<u16> = slot(0x1017, 0);
pub(crate) const SYNC_OVERFLOW: Slot<u8> = slot(0x1019, 0);
pub(crate) const COMMUNICATION_ERROR: Slot<u8> = slot(0x1029, 1);
#[doc(alias = "abort connection option code")]
pub(crate) const ABORT_CONNECTION_OPTION: Slot<i16> = slot(0x6007, 0);
pub(crate) const ERROR_CODE: Slot<u16> = slot(0x603F, 0);
pub(crate) const CONTROLWORD: Slot<u16> = slot(0x6040, 0);
pub(crate) const STATUSWORD: Slot<u16> = slot(0x6041, 0);
pub(crate) const QUICK_STOP_OPTION: Slot<i16> = slot(0x605A, 0);
pub(crate) const FAULT_OPTION: Slot<i16> = slot(0x605E, 0);
pub(crate) const MODE: Slot<i8> = slot(0x6060, 0);
pub(crate) const MODE_DISPLAY: Slot<i8> = slot(0x6061, 0);
pub(crate) const POSITION_DEMAND: Slot<i32> = slot(0x6062, 0);
pub(crate) const POSITION_ACTUAL: Slot<i32> = slot(0x6064, 0);
pub(crate) const FOLLOWING_WINDOW: Slot<u32> = slot(0x6065, 0);
pub(crate) const FOLLOWING_TIMEOUT_MS: Slot<u16> = slot(0x6066, 0);
pub(crate) const POSITION_WINDOW: Slot<u32> = slot(0x6067, 0);
pub(crate) const VELOCITY_ACTUAL: Slot<i32> = slot(0x606C, 0);
pub(crate) const TARGET_TORQUE: Slot<i16> = slot(0x6071, 0);
pub(crate) const MAX_TORQUE: Slot<u16> = slot(0x6072, 0);
pub(crate) const TORQUE_ACTUAL: Slot<i16> = slot(0x6077, 0);
pub(crate) const TARGET_POSITION: Slot<i32> = slot(0x607A, 0);
pub(crate) const HOME_OFFSET: Slot<i32> = slot(0x607C, 0);
#[doc(alias = "min software position limit")]
pub(crate) const MIN_POSITION_LIMIT: Slot<i32> = slot(0x607D, 1);
#[doc(alias = "max software position limit")]
pub(crate) const MAX_POSITION_LIMIT: Slot<i32> = slot(0x607D, 2);
pub(crate) const MAX_VELOCITY: Slot<u32> = slot(0x607F, 0);
pub(crate) const PROFILE_VELOCITY: Slot<u32> = slot(0x6081, 0);
pub(crate) const PROFILE_ACCELERATION: Slot<u32> = slot(0x6083, 0);
pub(crate) const PROFILE_DECELERATION: Slot<u32> = slot(0x6084, 0);
pub(crate) const QUICK_STOP_DECELERATION: Slot<u32> = slot(0x6085, 0);
pub(crate) const HOMING_METHOD: Slot<i8> = slot(0x6098, 0);
pub(crate) const HOMING_SPEED_SWITCH: Slot<u32> = slot(0x6099, 1);
pub(crate) const HOMING_SPEED_ZERO: Slot<u32> = slot(0x6099, 2);
pub(crate) const HOMING_ACCELERATION: Slot<u32> = slot(0x609A, 0);
pub(crate) const PERIOD_VALUE: Slot<u8> = slot(0x60C2, 1);
pub(crate) const PERIOD_INDEX: Slot<i8> = slot(0x60C2, 2);
pub(crate) const FOLLOWING_ERROR: Slot<i32> = slot(0x60F4, 0);
