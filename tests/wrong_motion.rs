//! Faults that lead the jaw off its path are detected before it is far, or fail the run.

use masseter_scenario::ChecksConfig;

use crate::common::{Cores, Workspace, check, stdout};
use serde_json::Value;

/// Drive l1 misses its targets for so many cycles from `from_s` on.
fn deaf_drive(from_s: f64, cycles: u32) -> String {
    let until_s = from_s + f64::from(cycles) * 1e-3;
    format!(
        "duration_s = 4.0\n[[faults]]\nkind = 'lose'\nbus = 1\nnode = 4\nid = 0x204\nfrom_s = {from_s}\nuntil_s = {until_s}\n"
    )
}

fn is_beyond(fault: &Value) -> bool {
    let [mm, deg] = ["deviation_mm", "deviation_deg"].map(|key| fault[key].as_f64().unwrap());
    let ChecksConfig { tracking_max_mm, tracking_max_deg, .. } = ChecksConfig::default();
    mm > tracking_max_mm || deg > tracking_max_deg
}

/// Also where the legs move fastest, 3.3 s after switch-on.
#[test]
fn a_drive_that_misses_its_targets_is_detected_before_the_jaw_is_far_from_its_path() {
    for from_s in [2.551, 3.301] {
        let workspace = Workspace::new(&deaf_drive(from_s, 80));
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(5), "{}", stdout(&output));
        let summary = workspace.summary();
        let fault = &summary["figures"]["faults"][0];
        assert!(!is_beyond(fault), "{fault}");
        assert!(fault["detection"]["latency_ms"].as_f64().unwrap() < 20.0, "{fault}");
        assert_eq!(check(&summary, "faults")["result"], "passed", "{}", stdout(&output));
    }
}

/// With wide limits of the drives and of the master, and `limit_m` for the controller.
fn lax(limit_m: f64) -> Workspace {
    let limits = format!(
        "[can]\nfollowing_limit_m = 1.0\n[controller]\ntracking_limit_m = {limit_m}\ntracking_limit_rad = 1.0\n\
         tracking_rms_limit_m = 1.0\ntracking_rms_limit_rad = 1.0"
    );
    Workspace::new(&(deaf_drive(2.551, 80) + &limits))
}

#[test]
fn a_fault_that_leads_the_jaw_far_from_its_path_fails_the_run_where_supervision_is_lax() {
    let workspace = lax(1.0);
    let output = workspace.run_virtual(&[]);
    let summary = workspace.summary();
    let found = (output.status.code(), check(&summary, "faults")["result"].as_str().unwrap());
    assert_eq!(found, (Some(1), "failed"), "{}", stdout(&output));
    let fault = &summary["figures"]["faults"][0];
    assert!(is_beyond(fault) && fault["detection"].is_null(), "{fault}");
}

/// The stop at 1.5 mm is three limits too late.
#[test]
fn a_safe_stop_that_comes_too_late_fails_the_run() {
    let workspace = lax(1.5e-3);
    let output = workspace.run_virtual(&[]);
    let summary = workspace.summary();
    for name in ["faults", "tracking"] {
        assert_eq!(check(&summary, name)["result"], "failed", "{}", stdout(&output));
    }
    assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
    let fault = &summary["figures"]["faults"][0];
    assert_eq!(fault["detection"]["cause"], "tracking_lost", "{fault}");
    let (deviation_mm, latency_ms) = (&fault["deviation_mm"], &fault["detection"]["latency_ms"]);
    assert!((1.5..1.7).contains(&deviation_mm.as_f64().unwrap()), "{fault}");
    assert!((5.0..40.0).contains(&latency_ms.as_f64().unwrap()), "{fault}");
    let peak_mm = summary["figures"]["tracking"]["incisal_max_mm"].as_f64().unwrap();
    assert!((1.5..1.7).contains(&peak_mm), "{peak_mm}");
}

/// The drive interpolates to its next target, as after a late SYNC.
#[test]
fn a_single_lost_target_leads_nowhere_and_passes() {
    let workspace = Workspace::new(&deaf_drive(3.281, 1));
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let fault = &workspace.summary()["figures"]["faults"][0];
    assert!(!is_beyond(fault) && fault["detection"].is_null(), "{fault}");
    assert!(fault["deviation_mm"].as_f64().unwrap() > 0.05, "{fault}");
}

/// A pose control of this integral gain, and supervision as `supervised` says. The motion is slow: with a lead of one cycle
/// the targets come a cycle late.
fn pose_control(gain_per_s: f64, supervised: &str) -> Workspace {
    Workspace::new(&format!(
        "duration_s = 1.0\n[motion]\nkind = 'chewing'\ncycle_rate_hz = 0.7\n[controller]\nlead_cycles = 1.0\n\
         integral_gain_per_s = {gain_per_s}\n{supervised}"
    ))
}

/// The machine may have disturbed a run in real time, and then explains its safe stop.
fn is_excused(summary: &Value) -> bool {
    summary["verdict"]["exit_code"] == 3 && summary["verdict"]["timing"]["word"] == "disturbed"
}

#[test]
fn a_gain_that_makes_the_pose_control_unstable_fails_under_every_clock() {
    // Supervision that lets the jaw leave its path: the checks find that.
    let lax = "tracking_limit_m = 0.1\ntracking_limit_rad = 1.0\ntracking_rms_limit_m = 0.1\n\
        tracking_rms_limit_rad = 1.0\n[can]\nfollowing_limit_m = 1.0\n[drives]\n\
        slide.max_acceleration_m_s2 = 2000.0\nleg.max_acceleration_m_s2 = 2000.0";
    for (supervised, expected) in [("", 5), (lax, 1)] {
        assert_eq!(pose_control(5.0, supervised).run_virtual(&[]).status.code(), Some(0), "{supervised}");
        for simulated in ["virtual", "lockstep"] {
            let workspace = pose_control(800.0, supervised);
            let output = match simulated {
                "virtual" => workspace.run_virtual(&[]),
                _ => workspace.start_lockstep(&[]).wait_with_output().unwrap(),
            };
            assert_eq!(output.status.code(), Some(expected), "{simulated}: {}", stdout(&output));
            if expected == 1 {
                assert_eq!(check(&workspace.summary(), "tracking")["result"], "failed");
            }
        }
        // Which limit is met first depends on the machine, too.
        let workspace = pose_control(800.0, supervised);
        let output = workspace.run(&Cores::take(), &[]);
        let is_failed = [Some(1), Some(5)].contains(&output.status.code());
        assert!(is_failed || is_excused(&workspace.summary()), "{}", stdout(&output));
    }
}
