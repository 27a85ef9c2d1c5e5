//! Any bytes as a mechanism, a guess and a stream of inputs: no panic, no pose that leaves the platform's sides
//! open by more than its certificate says, and none but the one that the complete method finds.
//!
//! Half of the numbers are taken as they are, which reaches NaN, infinities and absurd lengths; the other
//! half are scaled into what a mechanism has, which reaches the solver.

use arbitrary::{Result, Unstructured};
use masseter_controller::kinematics::{
    Certificate, Equations, ForwardError, ForwardTracker, Solution, solve_completely,
};
use masseter_model::geometry::{Actuators, LEGS, Mechanism, MechanismConfig};
use nalgebra::Vector3;

/// Roundings between the solver's corners and those made from its angles.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;
/// What a side of a mechanism of the paper's size may be off by, metres.
const CLOSED_WITHIN_M: f64 = 1e-12;
/// How far a pose's corners may be from the legs' ends, metres: the platform is rigid, the ends are not quite.
const CARRIED_WITHIN_M: f64 = 1e-11;

/// Feeds the target with these bytes.
///
/// # Panics
/// If what the head of this file says does not hold.
pub fn feed(data: &[u8]) {
    // Only the end of the bytes ends a stream.
    let _ = follow(&mut Unstructured::new(data));
}

fn follow(bytes: &mut Unstructured<'_>) -> Result<()> {
    let [raw_geometry, raw_guess, raw_inputs]: [bool; 3] = bytes.arbitrary()?;
    let Ok(mechanism) = Mechanism::new(&geometry(bytes, raw_geometry)?) else { return Ok(()) };
    let guess_rad = [
        number(bytes, raw_guess, -4.0, 4.0)?,
        number(bytes, raw_guess, -4.0, 4.0)?,
        number(bytes, raw_guess, -4.0, 4.0)?,
    ];
    let mut tracker = ForwardTracker::with_guess(mechanism.clone(), guess_rad);
    while !bytes.is_empty() {
        let actuators = input(bytes, raw_inputs)?;
        match tracker.update(&actuators) {
            Ok(solution) => {
                check_closure(&mechanism, &actuators, &solution);
                if !raw_geometry && !raw_inputs {
                    check_pose(&mechanism, &actuators, &solution);
                    check_alone(&mechanism, &actuators, &solution);
                }
            }
            Err(error) => assert!(!error.to_string().is_empty() && !error.reason().is_empty()),
        }
    }
    Ok(())
}

fn certificate(solution: &Solution) -> Certificate {
    assert!(solution.assembly.is_true(), "{solution:?}");
    solution.certificate.expect("what the tracker accepts is certified")
}

/// Each end of a side is at most as far from its true place as the certificate says.
fn check_closure(mechanism: &Mechanism, actuators: &Actuators, solution: &Solution) {
    let at = Equations::new(mechanism, actuators).evaluate(Vector3::from(solution.theta_rad));
    let longest_m = actuators.leg_m.into_iter().fold(0.0, f64::max);
    let most_m = 2.0 * certificate(solution).exists_within_rad * longest_m;
    for side in 0..LEGS {
        let extent_m = [side, (side + 1) % LEGS].map(|leg| at.corners[leg].norm() + actuators.leg_m[leg]);
        let rounding_m = ROUNDINGS * (extent_m[0] + extent_m[1] + mechanism.platform_sides_m()[side]);
        let off_m = at.residual_m[side].abs();
        assert!(off_m <= most_m + rounding_m, "{mechanism:?} {actuators:?}: {off_m} m in {solution:?}");
    }
}

/// On a mechanism of the paper's size the sides close to a picometre, and the pose carries the corners there.
fn check_pose(mechanism: &Mechanism, actuators: &Actuators, solution: &Solution) {
    assert!(solution.residual_m < CLOSED_WITHIN_M, "{actuators:?}: {solution:?}");
    let ends = mechanism.corners_from_angles(actuators, &solution.theta_rad);
    for (end, corner) in ends.iter().zip(mechanism.corners_at(&solution.pose)) {
        let apart_m = (end - corner).norm();
        assert!(apart_m < CARRIED_WITHIN_M, "{mechanism:?} {actuators:?}: {apart_m} m in {solution:?}");
    }
}

/// The complete method, which does not use earlier inputs, finds the same solution or more than one true one.
fn check_alone(mechanism: &Mechanism, actuators: &Actuators, tracked: &Solution) {
    match solve_completely(mechanism, actuators) {
        Ok(alone) => {
            let most_rad =
                certificate(&alone).exists_within_rad + certificate(tracked).exists_within_rad + ROUNDINGS;
            for (one, other) in alone.theta_rad.iter().zip(&tracked.theta_rad) {
                assert!((one - other).abs() <= most_rad, "{actuators:?}: {alone:?} but tracked {tracked:?}");
            }
        }
        Err(ForwardError::Ambiguous { .. } | ForwardError::Undecided { .. }) => {}
        Err(error) => panic!("{mechanism:?} {actuators:?}: tracked {tracked:?}, but alone {error}"),
    }
}

/// The paper's mechanism with every dimension off, or any numbers.
fn geometry(bytes: &mut Unstructured<'_>, raw: bool) -> Result<MechanismConfig> {
    let mut config = MechanismConfig::default();
    for slide in &mut config.slides {
        for coordinate_m in &mut slide.centre_m {
            *coordinate_m = off(bytes, raw, *coordinate_m, 0.005)?;
        }
        slide.azimuth_deg = off(bytes, raw, slide.azimuth_deg, 10.0)?;
    }
    for side_m in &mut config.platform_sides_m {
        *side_m = off(bytes, raw, *side_m, 0.005)?;
    }
    Ok(config)
}

fn input(bytes: &mut Unstructured<'_>, raw: bool) -> Result<Actuators> {
    let mut axes = [0.0; 6];
    for (index, axis) in axes.iter_mut().enumerate() {
        let (low, high) = if index < 3 { (-0.03, 0.03) } else { (0.24, 0.30) };
        *axis = number(bytes, raw, low, high)?;
    }
    Ok(Actuators::from_axes(axes))
}

fn off(bytes: &mut Unstructured<'_>, raw: bool, middle: f64, most: f64) -> Result<f64> {
    number(bytes, raw, middle - most, middle + most)
}

fn number(bytes: &mut Unstructured<'_>, raw: bool, low: f64, high: f64) -> Result<f64> {
    if raw {
        return bytes.arbitrary();
    }
    let share = f64::from(bytes.arbitrary::<u32>()?) / f64::from(u32::MAX);
    Ok(low + share * (high - low))
}
