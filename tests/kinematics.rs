//! `masseter ik` and `masseter fk` as a pipeline.

mod common;

use std::fmt::Write as _;
use std::io::Write;
use std::process::{Command, Output, Stdio};

use common::{MASSETER, masseter, stderr, stdout};

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
                 0,0,0,NaN,0.27,0.27\n0,0\n0,0,0,0.28,0.28,0.28\n";
    let output = pipe(&["fk"], input);
    assert_eq!(output.status.code(), Some(2));
    let statuses: Vec<_> =
        stdout(&output).lines().skip(1).map(|line| line.rsplit(',').next().unwrap().to_owned()).collect();
    assert_eq!(statuses, ["ok", "bad_line", "bad_line", "bad_line", "ok"]);
    for (line, reason) in [(3, "d3_m is 'zero'"), (4, "l1_m is NaN"), (5, "2 values, expected 6")] {
        assert!(stderr(&output).contains(&format!("standard input:{line}: {reason}")), "{}", stderr(&output));
    }
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

#[test]
fn wrong_columns_are_refused_with_the_right_ones() {
    let output = pipe(&["fk"], "a,b\n1,2\n");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("expected 'd1_m,d2_m,d3_m,l1_m,l2_m,l3_m'"), "{}", stderr(&output));
    assert_eq!(masseter(&["ik", "--input", "/nowhere.csv"]).status.code(), Some(2));
}
