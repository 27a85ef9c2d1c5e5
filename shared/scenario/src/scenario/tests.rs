use super::*;
use crate::DriveConfig;

fn parse(text: &str) -> Result<Scenario, String> {
    let scenario = Scenario::parse(Path::new("s.toml"), text).map_err(|error| error.to_string())?;
    scenario.validate().map_err(|error| error.to_string())?;
    Ok(scenario)
}

#[test]
fn the_largest_seed_is_one() {
    assert_eq!(parse("seed = 18446744073709551615").unwrap().seed, u64::MAX);
}

#[test]
fn an_empty_file_is_the_default_run() {
    assert_eq!(parse("").unwrap(), Scenario::default());
}

#[test]
fn a_key_missing_in_a_drives_table_keeps_its_default() {
    let default = Scenario::default().drives;
    let drives = parse("[drives.slide]\nfollowing_error_m = 1").unwrap().drives;
    assert_eq!(drives.slide, DriveConfig { following_error_m: 1.0, ..default.slide });
    assert_eq!(drives.leg, default.leg);
}

#[test]
fn a_resolved_scenario_reads_as_the_same_scenario() {
    let scenario = parse("name = 'x'\nduration_s = 3.0\n[motion]\nkind = 'opening'").unwrap();
    assert_eq!(parse(&scenario.to_toml()).unwrap(), scenario);
}

#[test]
fn a_value_out_of_range_is_placed_in_its_file_unless_it_is_not_from_there() {
    let path = std::env::temp_dir().join(format!("masseter-placed-{}.toml", std::process::id()));
    let fault = |bus| format!("[[faults]]\nkind = 'lose'\nbus = {bus}\nfrom_s = 1.0\n");
    std::fs::write(&path, format!("seed = 1\n{}{}", fault(0), fault(2))).unwrap();
    let scenario = Scenario::read(&path).unwrap();
    let in_file = Scenario::place_refusal(scenario.validate().unwrap_err(), &path).to_string();
    let replaced = Scenario { rate_hz: 5, ..scenario };
    let elsewhere = Scenario::place_refusal(replaced.validate().unwrap_err(), &path).to_string();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(
        in_file.split_once("masseter-placed-").unwrap().1.split_once(".toml").unwrap().1,
        ":8:1: faults.bus = 2: name a bus of can.buses, from 0"
    );
    assert!(elsewhere.starts_with("rate_hz = 5"), "{elsewhere}");
}

#[test]
fn long_and_strange_values_are_cut_and_escaped() {
    let long = "x".repeat(100_000);
    for text in [
        format!("rate_hz = '{long}'"),
        format!("name = '{long}'"),
        format!("{long} = 1"),
        format!("rate_hz = '{}'", "`\"".repeat(50_000)),
        format!("[motion]\nkind = '{long}'"),
        "name = \"\\u001b[2J\"".to_owned(),
        "rate_hz = \"\\u001b[2J\"".to_owned(),
        "\"\\u001b[2J\" = 1".to_owned(),
    ] {
        let error = parse(&text).unwrap_err();
        assert!(error.len() < 2500 && !error.contains('\u{1b}'), "{error}");
    }
}

#[test]
fn the_masters_port_may_be_faulty_on_a_real_interface() {
    let fault = "[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 127\nfrom_s = 1.0";
    let scenario = parse(&format!("[can]\ninterfaces = ['a', 'b']\n{fault}")).unwrap();
    assert_eq!(scenario.faults[0].node, Some(127));
}

/// Wrong scenarios, and a part of their refusals.
const WRONG: &[(&str, &str)] = &[
    ("seed = 1\nrate_hzz = 5", "s.toml:2:1: unknown key 'rate_hzz'"),
    ("seed = 1\n  rate_hz = 'fast'", "s.toml:2:13: rate_hz: \"fast\" is no whole number"),
    ("[drives.leg]\nmax_force_n = 'much'", "s.toml:2:1: drives.leg.max_force_n: \"much\" is no number"),
    ("rate_hz = 1e9", "rate_hz: 1000000000.0 is no whole number"),
    ("seed = -1", "seed: -1 is too small"),
    ("seed = 99999999999999999999", "seed: 99999999999999999999 is too large"),
    ("seed = 9999999999999999999999999999999999999999", "9999999999 has too many digits"),
    ("seed = 2026-01-01", "s.toml:1:8: seed: the date 2026-01-01 is no whole number"),
    ("duration_s = 2026-01-01", "s.toml:1:14: duration_s: the date 2026-01-01 is no number"),
    (
        "[motion]\nkind = 'chewing'\ncycle_rate_hz = 2026-01-01",
        "cycle_rate_hz: the date 2026-01-01 is no number",
    ),
    ("food = 2026-01-01", "food: the date 2026-01-01 is no value of this key"),
    ("can.node_ids = [1, 2, 3, 4, 5, 500]", "can.node_ids: 500 is too large"),
    ("can.node_ids = [1, 2]", "can.node_ids: a list of 2 is no list of 6"),
    ("include = 'a.toml'", "include: \"a.toml\" is no list; write it in brackets"),
    (
        "[drive_profile]\ndcf = 'a.dcf'",
        "drive_profile: a table is no list; write it in brackets, and a list of tables as [[NAME]]",
    ),
    ("[[matrix]]", "matrix: a list is no table"),
    ("expect = 'pass'", "expect: \"pass\" is no table"),
    ("name = 5", "name: 5 is no text; write it in quotes"),
    ("[recording]\nframes = 'no'", "recording.frames: \"no\" is neither true nor false"),
    ("[[stimulus]]\nname = 'push'", "stimulus: the key 'at_s' is missing"),
    ("[motion]\nkind = 'file'\npath = 'a'\nrate_hz = 'x'", "\"x\" is no number"),
    ("[can]\nbuses = [[0, 0, 1, 2, 3, 4]]", "can.buses = [[0, 0, 1, 2, 3, 4]]: axis 0 is named 2 times"),
    ("[motion]\nkind = 'chewing'\nvertical = 3.0", "s.toml:3:1: unknown key 'vertical'"),
    ("[motion]\nvertical_mm = []\nkind = 'chewing'", "s.toml:2:1: motion.vertical_mm: a list is no number"),
    (
        "[motion]\nkind = 'yawning'",
        "s.toml:2:8: motion.kind: unknown value 'yawning', expected one of 'chewing', ",
    ),
    ("seed = 1\n[motion]\nkind = 'file'\nfile = 'a.csv'", "s.toml:4:1: unknown key 'file'"),
    ("[motion]\nkind = 5", "s.toml:2:8: motion.kind: 5 is no name; write it in quotes"),
    (
        "[motion]\nkind = 'file'\npath = 'a'\ntime_unit = 3",
        "motion.time_unit: 3 is no name; write it in quotes",
    ),
    ("[force_control]\nsource = 3", "force_control.source: 3 is no name; write it in quotes"),
    ("expect.verdict = 2026-01-01", "expect.verdict: the date 2026-01-01 is no name; write it in quotes"),
    ("[[stimulus]]\nshape = 3\nat_s = 1.0", "stimulus.shape: 3 is no name; write it in quotes"),
    (
        "[[faults]]\nkind = 'disconnect'\nbus = 1\nsize = true\nfrom_s = 1.0",
        "faults.size: true is no number with its unit, such as \"50 um\"",
    ),
    ("[motion]\nkind = 'openning'", "did you mean 'opening'?"),
    ("[motion]\nkind = 'CHEWING'", "did you mean 'chewing'?"),
    ("[motion]\nkind = 'lateral'\nside = 'rigth'", "did you mean 'right'?"),
    ("[[faults]]\nkind = 'corupt'\nbus = 0\nfrom_s = 1.0", "did you mean 'corrupt'?"),
    ("[[faults]]\nkind = 'busoff'\nbus = 0\nfrom_s = 1.0", "did you mean 'bus_off'?"),
    ("[realtime]\ncpu_dma_latency = 'holds'", "did you mean 'hold'?"),
    ("checks = [999.0, 7]", "s.toml:1:10: checks is an array; write a table"),
    ("[drives]\nleg = [1.0]", "s.toml:2:7: drives.leg is an array; write a table"),
    ("food = [1.0, 2.0, 3.0]", "s.toml:1:8: food is an array; write a table"),
    ("seed = 1\nseed = 1", "s.toml:2:1: seed: the key is there already"),
    (
        "[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nprobability = 0.0",
        "faults.probability = 0: use more than 0",
    ),
    ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\ncount = 0", "faults.count = 0: use at least 1"),
    (
        "[[faults]]\nkind = 'lose'\nbus = 0\nnode = 0\nfrom_s = 1.0",
        "faults.node = 0: bus 0 has the nodes 127, 1, 2, 3",
    ),
    ("[can]\nnode_ids = [1, 2, 3, 4, 5, 127]", "can.node_ids = 127: use 1 to 126, none twice"),
    ("[can]\nnode_ids = [1, 2, 3, 4, 5, 1]", "can.node_ids = 1: use 1 to 126, none twice"),
    ("[controller]\nease_s = 1e-9", "controller.ease_s = 1e-9: use 0.1 to 86400"),
    (
        "[drives.leg]\nencoder_resolution_m = 1.0",
        "drives.leg.encoder_resolution_m = 1: use 0.000000000001 to 0.00001",
    ),
    ("[motion]\nkind = 'chewing'\nphases = [0.5, 0.4, 0.1]", "s.toml:3:10: motion.phases is an array"),
    ("faults = [['lose', 1]]", "s.toml:1:"),
    ("motion = ['chewing']", "s.toml:1:"),
    ("seed = 1\nrate_hzz = 5", "did you mean 'rate_hz'?"),
    ("[controller]\nease = 1.0", "did you mean 'ease_s'?"),
    ("[mechanism.strokes]\nslide_m = [0, 1]\nleg = [1, 2]", "did you mean 'leg_m'?"),
    ("[controller]\nlead_cycles = 1e308", "controller.lead_cycles = 1e308: use 0.001 to 10 cycles"),
    ("[controller]\nlead_cycles = 5e-324", "controller.lead_cycles = 5e-324: use 0.001 to 10 cycles"),
    ("rate_hz = 1", "use 10 to 20000 Hz"),
    ("duration_s = -1.0", "duration_s = -1: use 0.1 to 86400"),
    ("duration_s = 1e-320", "use 0.1 to 86400"),
    ("duration_s = nan", "use 0.1 to 86400"),
    ("name = '../x'", "letters"),
    ("[realtime]\npriority = 0", "use 1 to 99"),
    ("[realtime]\ncores = [1, 1]", "realtime.cores = 1,1: name two"),
    ("[can]\ninterfaces = ['can0']", "can.interfaces = can0: name 2 interfaces"),
    ("[can]\ninterfaces = ['can0', 'can0']", "name 2 interfaces"),
    ("[drives.leg]\nrated_force_n = nan", "drives.leg.rated_force_n = NaN: use a finite number above 0"),
    ("[drives.slide]\nencoder_noise_m = 1e300", "drives.slide.encoder_noise_m"),
    ("[dynamics]\nstep_ns = 1000000", "dynamics.step_ns = 1000000: use 10000 to 250000 ns"),
    ("[dynamics]\ngravity_m_s2 = -1.0", "dynamics.gravity_m_s2 = -1: use 0 to 100"),
    ("[dynamics]\ngravity_m_s2 = 1e5", "dynamics.gravity_m_s2 = 100000: use 0 to 100"),
    ("[dynamics]\ncarriage_mass_kg = 1e300", "dynamics.carriage_mass_kg = 1e300"),
    ("[dynamics]\nrod_mass_kg = 1e-300", "dynamics.rod_mass_kg = 1e-300"),
    ("[dynamics]\ncylinder_mass_kg = 0.0", "dynamics.cylinder_mass_kg = 0: use 0.001 to 100"),
    ("[dynamics]\nrod_inertia_kg_m2 = 1e12", "dynamics.rod_inertia_kg_m2"),
    ("[dynamics]\ncylinder_centre_m = 90.0", "dynamics.cylinder_centre_m = 90: use -0.5 to 0.5"),
    ("[dynamics]\nplatform_centre_m = [0.0, 0.0, nan]", "dynamics.platform_centre_m = NaN"),
    ("[dynamics]\nplatform_mass_kg = nan", "dynamics.platform_mass_kg = NaN: use 0.001 to 100"),
    (
        "[dynamics]\nplatform_inertia_kg_m2 = [1e-4, 1e-4, 1e-4, 0, 0, 20]",
        "dynamics.platform_inertia_kg_m2 = 20: use",
    ),
    (
        "[dynamics]\nplatform_inertia_kg_m2 = [1e-4, -1e-4, 1e-4, 0, 0, 0]",
        "a body has a positive inertia about every axis",
    ),
    (
        "[dynamics]\nplatform_inertia_kg_m2 = [1e-4, 1e-4, 1e-4, 0, 0, 2e-4]",
        "check signs and products of inertia",
    ),
    (
        "[dynamics]\nplatform_inertia_kg_m2 = [1e-4, 1e-4, 3e-4, 0, 0, 0]",
        "no inertia is larger than the other two together",
    ),
    (
        "[controller]\nfeed_forward_torque = true",
        "controller.feed_forward_torque = true: the drive of d1 takes no torque offset; add \"60B2h\" to rpdo1",
    ),
    ("[controller.model]\nplatform_mass_kg = 0.0", "controller.model.platform_mass_kg = 0: use 0.001 to 100"),
    ("[force_estimate]\nobserver_time_s = -1.0", "force_estimate.observer_time_s = -1: use 0 to 1"),
    (
        "[force_control]\ndamping_n_s_per_m = 1.0",
        "force_control.damping_n_s_per_m = 1: use at least 17.8: with less, the loop is not stable",
    ),
    ("[can]\nboot_timeout_ms = 0", "can.boot_timeout_ms = 0: use a finite number above 0"),
    ("[controller]\nease_s = 0.0", "controller.ease_s = 0: use 0.1 to"),
    ("[checks]\ntracking_rms_mm = inf", "checks.tracking_rms_mm"),
    (
        "[force_control]\nsource = 'load_cell'",
        "force_control.source = \"load_cell\": add the table [load_cell], or use \"estimate\"",
    ),
    (
        "[can]\ninterfaces = ['a', 'b']\n[force_control]\nsource = 'load_cell'",
        "force_control.source = \"load_cell\": use \"estimate\": on real interfaces",
    ),
    (
        "[force_estimate]\nfusion = 'load_cell'\ncalibration_s = 1.0",
        "force_estimate.fusion = \"load_cell\": add the table [load_cell], or use \"none\"",
    ),
    (
        "[can]\ninterfaces = ['a', 'b']\n[force_estimate]\nfusion = 'load_cell'\ncalibration_s = 1.0",
        "force_estimate.fusion = \"load_cell\": use \"none\": on real interfaces",
    ),
    (
        "[load_cell]\n[force_estimate]\nfusion = 'load_cell'",
        "force_estimate.calibration_s = 0: use a time without contact",
    ),
    (
        "[load_cell]\nnoise_n = 0.0\n[force_estimate]\nfusion = 'load_cell'\ncalibration_s = 1.0",
        "load_cell.noise_n = 0: use the noise of the cell",
    ),
    (
        "[load_cell]\noffset_n = -8.0\nrange_n = 8.4\n[force_estimate]\nfusion = 'load_cell'\ncalibration_s = 1.0",
        "load_cell.range_n = 8.4: use more than 8.5 N",
    ),
    (
        "[load_cell]\nrange_n = 30.0\n[force_control]\n[force_estimate]\nfusion = 'load_cell'\ncalibration_s = 1.0",
        "load_cell.range_n = 30: use more than 36.5 N",
    ),
    ("[force_control]\nsource = 'loadcell'", "did you mean 'load_cell'?"),
    ("[force_control]\npeak_n = 11.0\n[force_control.probe]", "force_control.peak_n = 11: use at least 12 N"),
    ("[force_control.probe]\nforce_n = 11.0", "force_control.probe.force_n = 11: use 12 to 30"),
    ("[force_control.lateral]\nreach_m = 0.0", "force_control.lateral.reach_m = 0: use"),
    (
        "[load_cell]\nbandwidth_hz = 10.0\n[force_control]\nsource = 'load_cell'\ndamping_n_s_per_m = 40.0",
        "force_control.damping_n_s_per_m = 40: use at least 46.6",
    ),
    (
        "[can]\ninterfaces = ['a', 'b']\n[load_cell]",
        "load_cell = given: leave the table away with can.interfaces: the rig reads no load cell there",
    ),
    (
        "[load_cell]\nrange_n = 74.4\noffset_n = -2.0\n[force_control]\nsource = 'load_cell'\npeak_n = 60.0",
        "load_cell.range_n = 74.4: use at least 74.5 N",
    ),
    (
        "[load_cell]\noffset_n = -5.0\n[force_control]\nsource = 'load_cell'",
        "load_cell.offset_n = -5: use less than 5 N on both sides, half of force_control.contact_n",
    ),
    (
        "[load_cell]\nnoise_n = 2.1\n[force_control]\nsource = 'load_cell'",
        "load_cell.noise_n = 2.1: use at most 2 N, a fifth of force_control.contact_n",
    ),
    ("[load_cell]\nbandwidth_hz = 0.0", "load_cell.bandwidth_hz = 0: use 1 to 100000"),
    ("[load_cell]\nnoise_n = -1.0", "load_cell.noise_n = -1: use 0 to 1000"),
    ("[load_cell]\noffset_n = nan", "load_cell.offset_n = NaN: use -1000 to 1000"),
    ("[load_cell]\nrange_n = 0.0", "load_cell.range_n = 0: use 0.1 to 100000"),
    ("[drives.leg]\nmax_force = 1.0", "did you mean 'max_force_n'?"),
    ("name = ", "s.toml:1"),
    ("[can]\nideal = true\ninterfaces = ['a', 'b']", "can.ideal = true: leave it away"),
    ("[[faults]]\nkind = 'corrupt'\nbus = 2\nfrom_s = 0.0", "faults.bus = 2: name a bus"),
    ("[[faults]]\nkind = 'babble'\nbus = 0\nfrom_s = 0.0", "faults.node = none"),
    (
        "[[faults]]\nkind = 'babble'\nbus = 0\nnode = 1\nfrom_s = 0.0\ndata = [1, 2, 3, 4, 5, 6, 7, 8, 9]",
        "faults.data = 9 bytes: a frame has at most 8 bytes",
    ),
    ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 0.0\ndata = [1]", "faults.data = given: leave it away"),
    (
        "[[faults]]\nkind = 'delay'\nbus = 0\nfrom_s = 0.0",
        "faults.size = none: give how long, such as \"1500 us\"",
    ),
    ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nuntil_s = 1.0", "faults.until_s = 1"),
    ("[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\nprobability = 1.5", "faults.probability"),
    (
        "[[faults]]\nkind = 'bus_off'\nbus = 0\nnode = 1\nfrom_s = 1.0\nprobability = 0.5",
        "faults.probability = given: leave it away: it has no effect on bus_off",
    ),
    (
        "[[faults]]\nkind = 'bus_off'\nbus = 0\nnode = 1\nfrom_s = 1.0\nid = 5",
        "faults.id = given: leave it away",
    ),
    (
        "[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nfrom_s = 1.0\ncount = 2",
        "faults.count = given: leave it away",
    ),
    ("[[faults]]\nkind = 'jam'\naxis = 'l2'", "faults.at_s = none: say when"),
    (
        "[[faults]]\nkind = 'jam'\naxis = 'x1'\nat_s = 1.0",
        "faults.axis = x1: name an axis: d1, d2, d3, l1, l2, l3",
    ),
    ("[[faults]]\nkind = 'jam'\nbus = 0\naxis = 'l2'\nat_s = 1.0", "faults.bus = given: leave it away"),
    (
        "[[faults]]\nkind = 'encoder_offset'\naxis = 'l2'\nat_s = 1.0\nsize = '1 N'",
        "faults.size = 1 N: give a number with one of the units m, mm",
    ),
    (
        "[[faults]]\nkind = 'jam'\naxis = 'l2'\nat_s = 1.0\nafter = 'fault.jamm'",
        "faults.after = 'fault.jamm': use fault.NAME, stimulus.NAME or controller.STATE; did you mean 'fault.jam'?",
    ),
    (
        "[[faults]]\nkind = 'jam'\naxis = 'l2'\nat_s = 1.0\nafter = 'fault.jam'",
        "faults.after = fault.jam after fault.jam: these times count from each other",
    ),
    (
        "[[faults]]\nkind = 'jam'\naxis = 'l2'\nat_s = 1.0\nafter = 'stimulus.push'\n\
         [[faults]]\nkind = 'plant_kill'\nat_s = 1.0\nafter = 'fault.drive_sto'\n\
         [[faults]]\nkind = 'drive_sto'\naxis = 'l2'\nat_s = 1.0\nafter = 'fault.jam'\n\
         [[stimulus]]\nat_s = 0.0\npush_n = [0, 0, 1]\nafter = 'fault.drive_sto'",
        "faults.after = fault.jam after stimulus.push after fault.drive_sto after fault.jam: these times",
    ),
    ("[expect]\nexit_code = 3", "expect.exit_code = 3: use 0, 1, 4, 5, 6 or 130"),
    (
        "[expect]\nexit_code = 5\nverdict = 'fail'",
        "expect.exit_code = 5: expect.verdict has the exit code 1: give one of both",
    ),
    ("[expect]\nverdict = 'fail'", "expect.failed = []: name the checks and requirements that must fail"),
    ("[expect]\nexit_code = 1", "expect.failed = []: name the checks and requirements that must fail"),
    (
        "[expect]\nverdict = 'safe_stop'\nfailed = ['tracking']",
        "expect.failed = [\"tracking\"]: it goes with",
    ),
    ("tags = ['slow one']", "tags = 'slow one': use 1 to 64 letters"),
    ("[matrix]\nrate_hz = 500", "matrix = rate_hz: give each key a list of values"),
    ("[[require]]\nname = 'a'\nid = 'REQ 1'", "require.id = 'REQ 1': use 1 to 64 bytes without spaces"),
    ("[[stimulus]]\nat_s = 1.0", "stimulus.push_n = none or several: give exactly one"),
    ("[[stimulus]]\nat_s = 1.0\nstop = true\nvalue = 1.0", "stimulus.value = given: leave it away"),
    ("[[stimulus]]\nat_s = 1.0\npush_n = [0, 0, 1]\nshape = 'ramp'", "stimulus.for_s = none"),
    (
        "[[stimulus]]\nat_s = 1.0\npush_n = [0, 0, 1]\npush_table = 'a.csv'",
        "none or several: give exactly one",
    ),
    (
        "[[stimulus]]\nat_s = 1.0\npush_table = 'a.csv'\nshape = 'sine'",
        "stimulus.shape = given: leave it away",
    ),
    (
        "[[stimulus]]\nat_s = 1.0\ntorque_n_m = [0, 0, 1]\npoint_m = [0, 0, 0]",
        "stimulus.point_m = given: leave it away",
    ),
    ("[[stimulus]]\nat_s = 1.0\ntorque_n_m = [0, 0, 201]", "stimulus.torque_n_m = 201: use -200 to 200"),
    ("[[require]]\nsignal = 'bite.force'", "require.name = ''"),
    ("[[require]]\nname = 'a'\nmax = '3 mms'", "the unit 'mms' is unknown"),
    ("[can]\nbitrate_bps = 2000000", "can.bitrate_bps = 2000000: bit rate 2000000"),
    ("[can]\nheartbeat_producer_ms = 0", "can.heartbeat_producer_ms = 0: use at least 1 ms"),
    ("[controller]\nhold_s = 1e9", "controller.hold_s = 1000000000: use more than 0 and at most 86400 s"),
    ("[limits]\nleg_velocity_m_s = nan", "limits.leg_velocity_m_s = NaN: use a finite number above 0"),
    ("[limits]\nmax_condition = -1.0", "limits.max_condition = -1: use a finite number above 0"),
    ("[food]\nkind = 'toffee'", "there is no kind 'toffee'; use soft, peanut, hazelnut, almond, gum"),
    ("[food]\nteeth = [16]", "food.teeth = 16: name lower teeth that the jaw has: 31, 32"),
    ("[teeth]\nmissing = [36]\n[food]", "food.teeth = 36: name lower teeth that the jaw has: 31, 32"),
    ("[food]\nteeth = [36, 36]", "food.teeth = [36, 36]: name at least one tooth, none twice"),
    ("[food]\nexponent = 2.0", "food.exponent = 2: use 1 to 1.5"),
    ("[food]\nfriction = -0.1", "food.friction = -0.1: use 0 to 2"),
    ("[food]\nthickness_m = 0.001", "food.swallowed_m = 0.002: use 0 to 0.001"),
    ("[[stimulus]]\nat_s = 1.0\n[stimulus.food]\nstrength_n = nan", "food.strength_n = NaN: use 0.1 to 1500"),
    ("[teeth]\nmissing = [18]", "teeth.missing = 18: use an FDI number of a lower tooth"),
    ("[teeth]\nclearance_m = -0.01", "teeth.clearance_m = -0.01: use -0.0005 to 0.02"),
    ("[teeth]\nstiff_n_per_m = 1e9", "teeth.stiff_n_per_m = 1000000000: use 1000 to 10000000"),
    (
        "[[teeth.tooth]]\nnumber = 36\npoint_m = [0, 0, 0]\nnormal = [1.0, 0.0, 0.0]",
        "teeth.tooth.normal = 0: use 0.5 to 1",
    ),
    ("teeth = [36]", "s.toml:1:9: teeth is an array; write a table"),
    ("[food]\nstiffness_n_per_m = 0.0", "food.stiffness_n_per_m = 0: use 1 to 1000000"),
    (
        "[force_estimate]\n[dynamics.friction]\nleg_screw_efficiency = 0.4",
        "dynamics.friction.leg_screw_efficiency = 0.4: use at least 0.7 with [force_estimate]",
    ),
    ("[food]\nthickness_mm = 10.0", "did you mean 'thickness_m'?"),
    ("[[faults]]\nkind = 'melt'\nbus = 0\nfrom_s = 1.0", "s.toml:2:8: faults.kind: unknown value 'melt'"),
    (
        "[can]\ninterfaces = ['a', 'b']\n[[faults]]\nkind = 'corrupt'\nbus = 0\nfrom_s = 1.0",
        "faults.kind = corrupt: leave it away with can.interfaces",
    ),
    (
        "[can]\ninterfaces = ['a', 'b']\n[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nfrom_s = 1.0",
        "faults.node = 1: on a real interface only the master (node 127)",
    ),
];

#[test]
fn wrong_scenarios_are_refused_with_place_and_remedy() {
    for (text, expected) in WRONG {
        let error = parse(text).unwrap_err();
        assert!(error.contains(expected), "{text:?} gave {error:?}");
    }
}

#[test]
fn another_kind_of_food_brings_its_values() {
    let soft = Scenario::parse(Path::new("s.toml"), "[food]").unwrap();
    let gum = Scenario::parse(Path::new("s.toml"), "[food]\nkind = 'gum'").unwrap();
    assert_eq!(soft.with("food.kind=gum").unwrap().food, gum.food);
    assert_ne!(soft.food, gum.food);
}

#[test]
fn the_file_of_a_robot_gives_the_defaults_of_its_scenarios() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let robot = "[dynamics]\nrod_mass_kg = 0.6\nplatform_mass_kg = 0.7\n[drives]\nmemory = 'flash.json'";
    write("robot.toml", robot);
    let path = write("slow.toml", "robot = 'robot.toml'\nrate_hz = 500\n[dynamics]\nrod_mass_kg = 0.8");
    let scenario = Scenario::read(&path).unwrap();
    assert_eq!((scenario.rate_hz, scenario.dynamics.rod_mass_kg), (500, 0.8), "the scenario's own keys win");
    assert!((scenario.dynamics.platform_mass_kg - 0.7).abs() < 1e-12);
    assert_eq!(scenario.drives.memory, Some(folder.path().join("flash.json")));
    let resolved = Scenario::parse(&path, &scenario.to_toml()).unwrap();
    assert_eq!(resolved.dynamics, scenario.dynamics, "the resolved scenario stands alone");

    let cases = [
        ("rate_hz = 500", "rate_hz does not describe a robot; a robot's file has mechanism,"),
        ("[dynamics]\nrod_mass_kg = 0.0", "other.toml:2:1: dynamics.rod_mass_kg = 0: use 0.001 to 100"),
        ("[dynamic]", "did you mean 'dynamics'?"),
    ];
    let path = write("own.toml", "robot = 'other.toml'");
    let error = Scenario::read(&path).unwrap_err().to_string();
    assert!(error.contains("own.toml: robot: ") && error.contains("other.toml: No such file"), "{error}");
    for (text, expected) in cases {
        write("other.toml", text);
        let error = Scenario::read(&path).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn an_included_file_gives_its_values_and_its_lists() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("common")).unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    write("common/robot.toml", "[dynamics]\nrod_mass_kg = 0.6");
    let common = "robot = 'robot.toml'\nrate_hz = 500\nduration_s = 3.0\ntags = ['slow']\n\
                  [motion]\nkind = 'file'\npath = 'jaw.csv'\n[[require]]\nname = 'of all'\nnever = 'safe_stop'";
    write("common/common.toml", common);
    let own =
        "include = ['common/common.toml']\nduration_s = 2.0\n[[require]]\nname = 'own'\nnever = 'safe_stop'";
    let path = write("own.toml", own);
    let scenario = Scenario::read(&path).unwrap();
    assert_eq!((scenario.rate_hz, scenario.duration_s), (500, Some(2.0)), "the scenario's own keys win");
    assert!((scenario.dynamics.rod_mass_kg - 0.6).abs() < 1e-12, "the included file names the robot");
    let names: Vec<_> = scenario.require.iter().map(|requirement| requirement.name.as_str()).collect();
    assert_eq!((names, scenario.tags.clone()), (vec!["own", "of all"], vec!["slow".to_owned()]));
    let MotionConfig::File(file) = &scenario.motion else { panic!("{:?}", scenario.motion) };
    assert_eq!(file.path, folder.path().join("common/jaw.csv"));
    let resolved = Scenario::parse(&path, &scenario.to_toml()).unwrap();
    assert_eq!((resolved.require, resolved.include), (scenario.require, Vec::new()));

    for (text, expected) in [
        ("include = ['own.toml']", "common.toml: an included file includes no other"),
        ("rate_hzz = 500", "common.toml:1:1: unknown key"),
    ] {
        write("common/common.toml", text);
        let error = Scenario::read(&path).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    for (text, expected) in
        [("include = ['none.toml']", "include"), ("[[drive_profile]]\ndcf = 'none.dcf'", "drive_profile.dcf")]
    {
        let error = Scenario::read(&write("own.toml", text)).unwrap_err().to_string();
        assert!(error.contains(&format!("own.toml: {expected}: ")) && error.contains("none."), "{error}");
    }
}

#[test]
fn the_controllers_model_is_that_of_the_mechanism_but_for_what_it_names() {
    let text =
        "[dynamics]\nplatform_mass_kg = 0.7\nrod_mass_kg = 0.3\n[controller.model]\nrod_mass_kg = 0.36";
    let scenario = Scenario::parse(Path::new("s.toml"), text).unwrap();
    assert_eq!(scenario.model(), DynamicsConfig { rod_mass_kg: 0.36, ..scenario.dynamics });
    // The same holds for a resolved scenario with another value by an argument.
    let scenario = scenario.with("controller.model.slide_friction_n=5").unwrap();
    assert_eq!(
        scenario.model(),
        DynamicsConfig { slide_friction_n: 5.0, rod_mass_kg: 0.36, ..scenario.dynamics }
    );
    assert_eq!(Scenario::default().model(), DynamicsConfig::default());
}

#[test]
fn feed_forward_is_accepted_where_every_drive_takes_torque_offsets() {
    let text = "[controller]\nfeed_forward_torque = true\n[[drive_profile]]\n\
                pdos = { rpdo1 = ['6040h', '607Ah', '60B2h'] }";
    assert!(Scenario::parse(Path::new("s.toml"), text).unwrap().validate().is_ok());
}

/// Work that grows with the square of the entries would take minutes.
#[test]
fn ten_thousand_entries_after_each_other_are_checked_at_once() {
    let fault = |number: usize, after: usize| {
        format!(
            "[[faults]]\nkind = 'encoder_stuck'\nname = 'f{number}'\naxis = 'l2'\nat_s = 0.0\nafter = 'fault.f{after}'\n"
        )
    };
    let first = "[[faults]]\nkind = 'encoder_stuck'\nname = 'f0'\naxis = 'l2'\nat_s = 0.0\n";
    let chain: String = (1..10_000).map(|number| fault(number, number - 1)).collect();
    let scenario = Scenario::parse(Path::new("s.toml"), &format!("{first}{chain}")).unwrap();
    scenario.validate().unwrap();
    let circle = Scenario::parse(Path::new("s.toml"), &format!("{chain}{}", fault(0, 9999))).unwrap();
    let refusal = circle.validate().unwrap_err().to_string();
    assert!(refusal.starts_with("faults.after = fault.f1 after fault.f0 after"), "{refusal}");
}
