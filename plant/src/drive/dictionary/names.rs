//! The entries that the drive itself reads and writes, by name.

use super::objects::{Slot, slot};

macro_rules! names {
    ($($name:ident: $type:ident = $index:literal, $subindex:literal;)*) => {
        $(pub(in crate::drive) const $name: Slot<$type> = slot($index, $subindex);)*
    };
}

names! {
    ERROR_REGISTER: u8 = 0x1001, 0;
    ERROR_COUNT: u8 = 0x1003, 0;
    NEWEST_ERROR: u32 = 0x1003, 1;
    EMERGENCY_COB_ID: u32 = 0x1014, 0;
    CONSUMER_HEARTBEAT_TIME: u32 = 0x1016, 1;
    PRODUCER_HEARTBEAT_TIME_MS: u16 = 0x1017, 0;
    SYNC_OVERFLOW: u8 = 0x1019, 0;
    COMMUNICATION_ERROR: u8 = 0x1029, 1;
    ABORT_CONNECTION_OPTION: i16 = 0x6007, 0;
    ERROR_CODE: u16 = 0x603F, 0;
    CONTROLWORD: u16 = 0x6040, 0;
    STATUSWORD: u16 = 0x6041, 0;
    QUICK_STOP_OPTION: i16 = 0x605A, 0;
    FAULT_OPTION: i16 = 0x605E, 0;
    MODE: i8 = 0x6060, 0;
    MODE_DISPLAY: i8 = 0x6061, 0;
    POSITION_DEMAND: i32 = 0x6062, 0;
    POSITION_ACTUAL: i32 = 0x6064, 0;
    FOLLOWING_WINDOW: u32 = 0x6065, 0;
    FOLLOWING_TIMEOUT_MS: u16 = 0x6066, 0;
    POSITION_WINDOW: u32 = 0x6067, 0;
    VELOCITY_ACTUAL: i32 = 0x606C, 0;
    TARGET_TORQUE: i16 = 0x6071, 0;
    MAX_TORQUE: u16 = 0x6072, 0;
    TORQUE_ACTUAL: i16 = 0x6077, 0;
    TARGET_POSITION: i32 = 0x607A, 0;
    HOME_OFFSET: i32 = 0x607C, 0;
    MIN_POSITION_LIMIT: i32 = 0x607D, 1;
    MAX_POSITION_LIMIT: i32 = 0x607D, 2;
    MAX_VELOCITY: u32 = 0x607F, 0;
    PROFILE_VELOCITY: u32 = 0x6081, 0;
    PROFILE_ACCELERATION: u32 = 0x6083, 0;
    PROFILE_DECELERATION: u32 = 0x6084, 0;
    QUICK_STOP_DECELERATION: u32 = 0x6085, 0;
    HOMING_METHOD: i8 = 0x6098, 0;
    HOMING_SPEED_SWITCH: u32 = 0x6099, 1;
    HOMING_SPEED_ZERO: u32 = 0x6099, 2;
    HOMING_ACCELERATION: u32 = 0x609A, 0;
    PERIOD_VALUE: u8 = 0x60C2, 1;
    PERIOD_INDEX: i8 = 0x60C2, 2;
    FOLLOWING_ERROR: i32 = 0x60F4, 0;
}
