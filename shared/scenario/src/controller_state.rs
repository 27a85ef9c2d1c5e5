//! The states of a controller's sequence, which faults and requirements of a scenario name.

use masseter_can::codes;

codes! {
    /// State of the controller's sequence.
    ControllerState as u32 {
        /// No steady readings yet; drives off.
        WaitReadings = 0 "wait_readings",
        /// Bringing all drives to operation enabled, holding where they are.
        Enabling = 1 "enabling",
        /// Easing from the measured pose to the first pose of the motion.
        Easing = 2 "easing",
        /// Playing the motion.
        Running = 3 "running",
        /// Holding the last pose.
        Holding = 4 "holding",
        /// Switching the drives off.
        Disabling = 5 "disabling",
        /// Done: drives off.
        Finished = 6 "finished",
        /// Stopped by a fault: quick stop requested, nothing moves again.
        SafeStop = 7 "safe_stop",
    }
}
