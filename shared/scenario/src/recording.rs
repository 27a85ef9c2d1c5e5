//! What a run records.

section! {
    /// What the recording of a run contains.
    #[derive(Copy, Eq)]
    pub struct RecordingConfig {
        /// The CAN frames. Without them a run has no response times and no load of the buses, and no candump
        /// logs.
        pub frames: bool = true,
    }
}
