//! The place of the jaw on the platform: `[jaw]`.
//!
//! The trajectory checks these values.

section! {
    /// The place of the lower jaw on the platform, and the dimensions of the mandible.
    #[derive(Copy)]
    pub struct JawConfig {
        /// Length of all three legs at the closed pose, slides in the middle, metres.
        pub closed_leg_m: f64 = 0.2974,
        /// Shift of the closed pose from there, base frame, metres. A jaw that opens far back gains
        /// stroke by being closed further forward.
        pub closed_offset_m: [f64; 3] = [0.0; 3],
        /// The incisal point (origin of the jaw frame) in the platform frame, metres.
        /// By default corner A₁ of the paper's platform.
        pub reference_point_m: [f64; 3] = [0.05 / 3f64.sqrt(), 0.0, 0.0],
        /// Side of Bonwill's triangle (both condyles and the incisal point), metres.
        pub bonwill_side_m: f64 = 0.100,
        /// Balkwill angle between Bonwill's triangle and the occlusal plane, degrees.
        pub balkwill_angle_deg: f64 = 22.5,
    }
}
