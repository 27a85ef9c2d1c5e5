//! `masseter ik` and `masseter fk` as a pipeline.

use std::fmt::Write as _;
use std::io::Write;
use std::process::{Command, Output, Stdio};

use crate::common::{MASSETER, masseter, stderr, stdout};

fn pipe(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(MASSETER)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

/// [`pipe`] for input that does not fit into a pipe.
fn pipe_at_once(arguments: &[&str], input: &str) -> Output {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), input).unwrap();
    let mut command = Command::new(MASSETER);
    command.args(arguments).stdin(std::fs::File::open(file.path()).unwrap());
    command.output().unwrap()
}

/// What each line ends with.
fn statuses(output: &Output) -> Vec<String> {
    stdout(output).lines().skip(1).map(|line| line.rsplit(',').next().unwrap().to_owned()).collect()
}

fn columns(line: &str) -> Vec<f64> {
    line.split(',').map_while(|value| value.parse().ok()).collect()
}

#[test]
fn poses_survive_the_way_through_the_joints() {
    let mut poses = "x_m,y_m,z_m,qw,qx,qy,qz\n".to_owned();
    for i in 0..200 {
        let phase = f64::from(i) * 0.1;
        let half = 0.1 * phase.sin();
        let (x, y) = (0.01 * phase.cos(), 0.005 * phase.sin());
        writeln!(poses, "{x},{y},0.27,{},0,{},0", half.cos(), half.sin()).unwrap();
    }
    let joints = pipe(&["ik"], &poses);
    assert_eq!(joints.status.code(), Some(0), "{}", stderr(&joints));
    let actuators: String = stdout(&joints)
        .lines()
        .map(|line| line.split(',').take(6).collect::<Vec<_>>().join(",") + "\n")
        .collect();
    for extra in [&["fk"][..], &["fk", "--continuous"]] {
        let again = pipe(extra, &actuators);
        assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
        assert_eq!(stdout(&again).lines().count(), poses.lines().count());
        for (before, after) in poses.lines().zip(stdout(&again).lines()).skip(1) {
            assert!(after.ends_with(",ok"), "{after}");
            for (before, after) in columns(before).iter().zip(columns(after)) {
                assert!((before - after).abs() < 1e-10, "{before} became {after}");
            }
        }
    }
}

#[test]
fn a_bad_line_is_named_and_the_rest_is_done() {
    let input = "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m\n0,0,0,0.27,0.27,0.27\n0,0,zero,0.27,0.27,0.27\n\
                 0,0,0,NaN,0.27,0.27\n0,0\n\n\"0,0,0,0.27,0.27,0.27\n\
                 0,0,0,0.28,0.28,0.28\n";
    let output = pipe(&["fk"], input);
    assert_eq!(output.status.code(), Some(2));
    let expected = ["ok", "bad_line", "bad_line", "bad_line", "bad_line", "bad_line", "ok"];
    assert_eq!(statuses(&output), expected);
    let reasons = [
        (3, "d3_m is 'zero'"),
        (4, "l1_m is 'NaN'"),
        (5, "2 fields, expected 6"),
        (6, "an empty line"),
        (7, "d1_m is '\"0'"),
    ];
    for (line, reason) in reasons {
        assert!(stderr(&output).contains(&format!("standard input:{line}: {reason}")), "{}", stderr(&output));
    }
}

#[test]
fn a_line_that_is_no_text_is_named_and_the_rest_is_done() {
    let input =
        [ACTUATORS.as_bytes(), b"0,0,0,0.27,0.27,0.27\n0,0,\xff,0.27,0.27,0.27\n0,0,0,0.28,0.28,0.28\n"];
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), input.concat()).unwrap();
    let name = file.path().to_str().unwrap();
    let output = masseter(&["fk", "--input", name]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains(&format!("{name}:3: ")), "{}", stderr(&output));
    assert_eq!(statuses(&output), ["ok", "bad_line", "ok"]);
}

#[test]
fn quotes_around_names_and_numbers_are_borne() {
    let quoted = ACTUATORS.trim().split(',').map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(",");
    let output = pipe(&["fk"], &format!("{quoted}\n\"0\",0,0,0.27,\"0.27\",0.27\n"));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn statuses_name_what_the_mechanism_cannot_do() {
    let outside = pipe(&["ik"], "x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0.5,1,0,0,0\n");
    assert_eq!(outside.status.code(), Some(0));
    assert!(stdout(&outside).lines().nth(1).unwrap().ends_with(",outside_stroke"));
    let apart = pipe(&["fk"], "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m\n0.03,-0.03,0,0.3,0.24,0.24\n");
    assert_eq!(apart.status.code(), Some(0));
    let line = stdout(&apart).lines().nth(1).unwrap().to_owned();
    assert!(!line.ends_with(",ok") && line.starts_with(",,,"), "{line}");
}

/// Rounding hides a mechanism of centimetres on legs of a thousand kilometres: no other word is true of such a line.
#[test]
fn positions_beyond_a_kilometre_are_out_of_range_and_named_with_the_range() {
    let legs = "0,0,0,1e8,1e8,1e8\n0,0,0,1e154,1e154,1e154\n0,0,-1001,0.27,0.27,0.27\n0,0,0,0.27,0.27,0.27\n";
    for more in [&[][..], &["--continuous"], &["--solver", "newton"], &["--all"]] {
        let output = pipe(&[&["fk"], more].concat(), &format!("{ACTUATORS}{legs}"));
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(statuses(&output)[..3], ["out_of_range"; 3], "{more:?}");
        assert!(!statuses(&output)[3..].contains(&"out_of_range".to_owned()), "{more:?}");
        let said = "standard input:2: 1e8 m is out of range; use -1000 to 1000 m";
        assert!(stderr(&output).contains(said), "{}", stderr(&output));
    }
    let poses = "x_m,y_m,z_m,qw,qx,qy,qz\n0,0,1e300,1,0,0,0\n0,0,999,1,0,0,0\n";
    let output = pipe(&["ik"], poses);
    assert_eq!(statuses(&output), ["out_of_range", "outside_stroke"]);
    assert!(stderr(&output).contains("1e300 m is out of range"), "{}", stderr(&output));
}

/// Upside down, and below the base: the strokes would do, and `fk` gives another pose for them.
#[test]
fn a_pose_in_which_the_mechanism_cannot_stand_is_a_wrong_assembly() {
    let output = pipe(
        &["ik"],
        "x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0.27,0,1,0,0\n0,0,-0.27,1,0,0,0\n0,0,0.27,1,0,0,0\n0,0,-0.5,1,0,0,0\n",
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(statuses(&output), ["wrong_assembly", "wrong_assembly", "ok", "wrong_assembly"]);
    assert!(stdout(&output).lines().skip(1).all(|line| columns(line).len() == 9), "{}", stdout(&output));
}

#[test]
fn wrong_columns_are_refused_with_the_right_ones() {
    let output = pipe(&["fk"], "a,b\n1,2\n");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("expected 'd1_m,d2_m,d3_m,l1_m,l2_m,l3_m'"), "{}", stderr(&output));
    assert_eq!(masseter(&["ik", "--input", "/nowhere.csv"]).status.code(), Some(2));
}

const ACTUATORS: &str = "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m\n";

#[test]
fn all_solutions_of_the_neutral_input_are_listed_with_their_conditions() {
    let output = pipe(&["fk", "--all"], &format!("{ACTUATORS}0,0,0,0.27,0.27,0.27\n"));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let output = stdout(&output);
    let (header, lines) = output.split_once('\n').unwrap();
    assert!(header.starts_with("line,x_m,") && header.ends_with(",residual_m,status"), "{header}");
    assert_eq!(lines.lines().count(), 16);
    let true_ones: Vec<_> = lines.lines().filter(|line| line.ends_with(",true")).collect();
    assert_eq!(true_ones.len(), 1);
    let values = columns(true_ones[0]);
    assert!((values[3] - 0.268_452_355).abs() < 1e-9);
    assert_eq!(values[11..15], [1.0; 4]);
    assert!(values[16] > 0.5 && values[17] > 1.0);
}

/// A pose at which the determinant is 10⁻⁹, and a pair of solutions 1.5·10⁻⁴ rad apart.
#[test]
fn solutions_that_rounding_cannot_separate_are_both_marked_singular() {
    let singular = "0.014985880362082765,0.00826232132276009,0.035219106697652394,\
                    0.3004420425771831,0.2662413895938286,0.2655512934340976";
    let close = "-0.00902631714950948,-0.004133527909131813,0.013522157666649465,\
                 0.29963087076144573,0.2960203695460343,0.2860935151311134";
    let output = pipe(&["fk", "--all"], &format!("{ACTUATORS}{singular}\n{close}\n"));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let of_line = |number: &str| {
        let all = stdout(&output);
        let lines = all.lines().filter(|line| line.starts_with(&format!("{number},")));
        lines.map(|line| (columns(line)[8], line.rsplit(',').next().unwrap().to_owned())).collect::<Vec<_>>()
    };
    let above: Vec<_> = of_line("2").into_iter().filter(|(theta_rad, _)| *theta_rad > 0.0).collect();
    assert_eq!(above.len(), 2, "{above:?}");
    for (theta_rad, status) in above {
        assert!((theta_rad - 1.447_191_76).abs() < 1e-5 && status == "singular", "{theta_rad} {status}");
    }
    assert_eq!(of_line("3").len(), 16);
    assert!(of_line("3").iter().all(|(_, status)| status != "singular"));
}

#[test]
fn an_input_without_any_solution_gives_one_line_with_the_reason() {
    let output = pipe(&["fk", "--all"], &format!("{ACTUATORS}0,0,0,0.01,0.30,0.30\n"));
    let lines: Vec<_> = stdout(&output).lines().skip(1).map(str::to_owned).collect();
    assert!(
        lines.len() == 1 && lines[0].starts_with("2,,,") && lines[0].ends_with(",,unassemblable"),
        "{lines:?}"
    );
}

#[test]
fn every_solver_finds_the_neutral_pose_and_a_guess_below_the_base_its_mirror_image() {
    let input = format!("{ACTUATORS}0,0,0,0.27,0.27,0.27\n");
    for solver in ["controller", "published", "newton"] {
        let near = pipe(&["fk", "--solver", solver, "--guess", "1.5,1.4,1.5"], &input);
        let line = stdout(&near).lines().nth(1).unwrap().to_owned();
        assert!(line.ends_with(",ok") && (columns(&line)[2] - 0.268_452_355).abs() < 1e-9, "{line}");
        let below = pipe(&["fk", "--solver", solver, "--guess", "-1.5,-1.4,-1.5"], &input);
        let line = stdout(&below).lines().nth(1).unwrap().to_owned();
        let expected = if solver == "controller" { ",ok" } else { ",wrong_assembly" };
        assert!(line.ends_with(expected), "{solver}: {line}");
    }
    for wrong in [["--guess", "1.5,1.5"], ["--guess", "NaN,1,1"], ["--solver", "other"]] {
        assert_eq!(masseter(&[&["fk"], &wrong[..]].concat()).status.code(), Some(2));
    }
}

/// More lines than one batch holds, with a bad one in the second.
#[test]
fn many_lines_come_out_in_order() {
    const LINES: usize = 40_000;
    const BAD: usize = 30_000;
    let mut input = ACTUATORS.to_owned();
    for i in 0..LINES {
        let leg_m = if i == BAD { "long".to_owned() } else { (0.25 + 1e-6 * i as f64).to_string() };
        writeln!(input, "0,0,0,{leg_m},{leg_m},{leg_m}").unwrap();
    }
    let output = pipe_at_once(&["fk"], &input);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains(&format!("standard input:{}: l1_m is 'long'", BAD + 2)));
    let heights: Vec<_> = stdout(&output)
        .lines()
        .skip(1)
        .map(|line| columns(line).get(2).copied().ok_or_else(|| line.to_owned()))
        .collect();
    assert_eq!(heights.len(), LINES);
    assert!(heights[BAD].as_ref().is_err_and(|line| line.ends_with(",bad_line")));
    let good: Vec<_> = heights.into_iter().flatten().collect();
    assert!(good.len() == LINES - 1 && good.is_sorted());
}
