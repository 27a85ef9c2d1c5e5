//! One recording as trackers write it: every form is read as the plain one, or refused with the key that helps.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use masseter_scenario::{AngleUnit, LengthUnit, TimeUnit};

use super::*;

/// Largest difference from the plain form, in s, mm and parts of a quaternion; and of a file of floats.
const NEAR: f64 = 1e-6;
const NEAR_FLOAT: f64 = 4e-5;
const ROWS: usize = 120;
const RATE_HZ: f64 = 100.0;
const POSES: &str = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz";
/// Twelve markers off one line, mm; no two of their distances are equal.
const CORNERS: [[f64; 3]; 12] = [
    [100.0, 200.0, 300.0],
    [141.0, 203.0, 301.0],
    [110.0, 233.0, 307.0],
    [120.0, 215.0, 322.0],
    [95.0, 190.0, 330.0],
    [150.0, 240.0, 290.0],
    [80.0, 260.0, 315.0],
    [133.0, 181.0, 345.0],
    [104.0, 222.0, 271.0],
    [160.0, 210.0, 333.0],
    [88.0, 205.0, 352.0],
    [127.0, 251.0, 339.0],
];

/// A jaw that opens by 20° and turns aside: time in s, place in mm, turn.
fn motion() -> Vec<(f64, Vec3, UnitQuaternion<f64>)> {
    let row = |row: usize| {
        let time_s = row as f64 / RATE_HZ;
        let share = (1.0 - (TAU * time_s).cos()) / 2.0;
        let turn = Vec3::new(0.05, 0.35, -0.08) * share;
        (time_s, Vec3::new(7.0, 1.5, -6.0) * share, UnitQuaternion::from_scaled_axis(turn))
    };
    (0..ROWS).map(row).collect()
}

fn poses() -> Vec<Vec<f64>> {
    let row = |(time_s, place, turn): (f64, Vec3, UnitQuaternion<f64>)| {
        vec![time_s, place.x, place.y, place.z, turn.w, turn.i, turn.j, turn.k]
    };
    motion().into_iter().map(row).collect()
}

fn markers(count: usize) -> Vec<Vec<f64>> {
    let row = |(time_s, place, turn): (f64, Vec3, UnitQuaternion<f64>)| {
        let corners = CORNERS[..count].iter().flat_map(|corner| {
            let moved: Vec3 = turn * Vec3::from(*corner) + place;
            [moved.x, moved.y, moved.z]
        });
        [time_s].into_iter().chain(corners).collect()
    };
    motion().into_iter().map(row).collect()
}

fn marker_header(count: usize) -> String {
    let names = (1..=count).flat_map(|marker| ["x", "y", "z"].map(|axis| format!(",m{marker}_{axis}_mm")));
    format!("time_s{}", names.collect::<String>())
}

/// Angles about x, y, z: of turns about moving axes in the order x, y, z.
fn moving_angles(turn: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = turn.to_rotation_matrix().into_inner();
    [(-matrix[(1, 2)]).atan2(matrix[(2, 2)]), matrix[(0, 2)].asin(), (-matrix[(0, 1)]).atan2(matrix[(0, 0)])]
}

fn cells(rows: &[Vec<f64>]) -> Vec<Vec<String>> {
    rows.iter().map(|row| row.iter().map(|number| format!("{number}")).collect()).collect()
}

fn text_of(header: &str, rows: &[Vec<String>], separator: &str) -> String {
    let lines = rows.iter().map(|row| row.join(separator));
    [header.to_owned()].into_iter().chain(lines).collect::<Vec<_>>().join("\n") + "\n"
}

/// The poses under another header; `change` makes a row of the header's from one of the plain form.
fn with(header: &str, change: impl Fn(&[f64]) -> Vec<f64>) -> String {
    text_of(header, &cells(&poses().iter().map(|row| change(row)).collect::<Vec<_>>()), ",")
}

fn same(row: &[f64]) -> Vec<f64> {
    row.to_vec()
}

/// The poses with the cells of some rows changed.
fn lost(change: impl Fn(&mut Vec<String>)) -> String {
    let mut rows = cells(&poses());
    rows[40..45].iter_mut().for_each(change);
    text_of(POSES, &rows, ",")
}

/// The poses in rows at a rate, some of them without a cell.
fn without_times(separator: &str) -> String {
    let rows = lost(|row| row.iter_mut().for_each(String::clear));
    let rows = rows.lines().map(|row| row.split_once(',').map_or("", |(_, cells)| cells));
    rows.map(|row| row.replace(',', separator) + "\n").collect()
}

fn separated(separator: &str, mark: &str) -> String {
    let mut rows = cells(&poses());
    rows.iter_mut().flatten().for_each(|cell| *cell = cell.replace('.', mark));
    text_of(&POSES.replace(',', separator), &rows, separator)
}

fn place_and(row: &[f64], rest: &[f64]) -> Vec<f64> {
    [&row[..4], rest].concat()
}

fn turn_of(row: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(row[4], row[5], row[6], row[7]))
}

fn matrix(row: &[f64], is_by_columns: bool) -> Vec<f64> {
    let mut matrix = turn_of(row).to_homogeneous();
    (0..3).for_each(|axis| matrix[(axis, 3)] = row[1 + axis]);
    let rows = if is_by_columns { matrix } else { matrix.transpose() };
    [&row[..1], rows.as_slice()].concat()
}

fn matrix_header(base: usize, rows: usize) -> String {
    let names =
        (0..rows).flat_map(|row| (0..4).map(move |column| format!(",m{}{}", row + base, column + base)));
    format!("time_s{}", names.collect::<String>())
}

fn clock(from_s: f64) -> String {
    let mut rows = cells(&poses());
    for (row, pose) in rows.iter_mut().zip(poses()) {
        let time_s = (from_s + pose[0]) % 86_400.0;
        let (minutes, seconds) = ((time_s / 60.0).floor(), time_s % 60.0);
        row[0] = format!("{:02}:{:02}:{seconds:010.7}", (minutes / 60.0).floor(), minutes % 60.0);
    }
    text_of(POSES, &rows, ",")
}

fn trc(units: &str, size: f64) -> String {
    let head = "PathFileType\t4\t(X/Y/Z)\tjaw.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n100\t100\t120\t3\t";
    let names = "Frame#\tTime\tLI\t\t\tRM\t\t\tLM\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3\n";
    let row = |(frame, row): (usize, &Vec<f64>)| {
        let places = row[1..].iter().map(|mm| mm * size);
        [frame as f64 + 1.0, row[0]].into_iter().chain(places).collect()
    };
    let rows: Vec<Vec<f64>> = markers(3).iter().enumerate().map(row).collect();
    text_of(&format!("{head}{units}\n{names}"), &cells(&rows), "\t")
}

fn mot(degrees: &str, size: f64) -> String {
    let head = format!("jaw\nversion=1\nnRows=120\nnColumns=7\ninDegrees={degrees}\nendheader\n");
    let row = |row: &Vec<f64>| {
        let angles = moving_angles(&turn_of(row)).map(|rad| rad * size);
        [row[0], row[1] / 1e3, row[2] / 1e3, row[3] / 1e3, angles[0], angles[1], angles[2]].to_vec()
    };
    let rows: Vec<_> = poses().iter().map(row).collect();
    text_of(&(head + "time\tjaw_tx\tjaw_ty\tjaw_tz\tjaw_rx\tjaw_ry\tjaw_rz"), &cells(&rows), "\t")
}

/// A text as bytes of another code page.
fn utf_16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(unit).collect()
}

#[derive(Clone, Copy)]
enum Plain {
    Poses,
    Markers(usize),
    /// Markers with 24 bits.
    Floats(usize),
}

#[derive(Clone, Copy)]
enum Expected {
    /// Read as the plain form, but for rows that are gaps.
    Read(Plain, usize),
    Refused(&'static str),
}
use Expected::{Read, Refused};

fn no_keys(_: &mut FileConfig) {}

type Keys = fn(&mut FileConfig);

fn euler(config: &mut FileConfig) {
    config.euler_order = Some("XYZ".to_owned());
}

fn named(names: &str) -> Vec<String> {
    names.split(',').map(str::to_owned).collect()
}

type Case = (&'static str, String, Keys, Expected);

const PREAMBLE: &str = "zebris JMA Export;Version 1.2\nPatient;Mustermann\n\n";
const WHOLE: Expected = Read(Plain::Poses, 0);

fn radians(row: &[f64]) -> Vec<f64> {
    place_and(row, &moving_angles(&turn_of(row)))
}

fn degrees(row: &[f64]) -> Vec<f64> {
    place_and(row, &moving_angles(&turn_of(row)).map(f64::to_degrees))
}

fn fixed(row: &[f64]) -> Vec<f64> {
    let (x, y, z) = turn_of(row).euler_angles();
    place_and(row, &[x, y, z])
}

fn scaled(time: f64, place: f64) -> impl Fn(&[f64]) -> Vec<f64> {
    move |row| [&[row[0] * time, row[1] * place, row[2] * place, row[3] * place], &row[4..]].concat()
}

fn scalar_last(row: &[f64]) -> Vec<f64> {
    place_and(row, &[row[5], row[6], row[7], row[4]])
}

fn frames(row: &[f64]) -> Vec<f64> {
    [&[(row[0] * RATE_HZ).round() + 7.0], &row[1..]].concat()
}

fn quoted() -> String {
    let lines = separated(",", ".");
    let quoted = |line: &str| format!("\n\"{}\"", line.replace(',', "\",\"").replace('.', ","));
    lines.lines().skip(1).fold(POSES.to_owned(), |text, line| text + &quoted(line))
}

fn separators() -> Vec<Case> {
    vec![
        ("plain", separated(",", "."), no_keys, WHOLE),
        ("semicolon", separated(";", "."), no_keys, WHOLE),
        ("semicolon, decimal comma", separated(";", ","), no_keys, WHOLE),
        ("tab", separated("\t", "."), no_keys, WHOLE),
        ("tab, decimal comma", separated("\t", ","), no_keys, WHOLE),
        ("spaces", separated("   ", "."), no_keys, WHOLE),
        ("spaces, decimal comma", separated(" ", ","), no_keys, WHOLE),
        ("quoted decimal comma", quoted(), no_keys, WHOLE),
        ("comma, decimal comma", separated(",", ","), no_keys, Refused("another separator")),
        (
            "both decimal marks",
            separated(";", ".").replacen("0.01;", "0,01;", 1),
            no_keys,
            Refused("decimal mark"),
        ),
        (
            "thousands",
            separated(";", ".").replacen("\n0.01;", "\n1,000.01;", 1),
            no_keys,
            Refused(":3: column 1"),
        ),
        ("line ends of Windows", separated(",", ".").replace('\n', "\r\n"), no_keys, WHOLE),
    ]
}

fn headers() -> Vec<Case> {
    vec![
        ("units in brackets", with("Time [s],X [mm],Y [mm],Z [mm],q0,q1,q2,q3", same), no_keys, WHOLE),
        (
            "brackets between spaces",
            separated(" ", ".").replace("time_s x_mm", "Time [s]  X [mm]"),
            no_keys,
            WHOLE,
        ),
        ("capitals", with("TIME_S,X_MM,Y_MM,Z_MM,QW,QX,QY,QZ", same), no_keys, WHOLE),
        (
            "words",
            with("Time (sec),PosX (mm),PosY (mm),PosZ (mm),Quat W,Quat X,Quat Y,Quat Z", same),
            no_keys,
            WHOLE,
        ),
        ("bare quaternion", with("time_s,Tx_mm,Ty_mm,Tz_mm,w,x,y,z", same), no_keys, WHOLE),
        ("scalar last", with("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw", scalar_last), no_keys, WHOLE),
        (
            "turn before place",
            with("time_s,qw,qx,qy,qz,x_mm,y_mm,z_mm", |row| [&row[..1], &row[4..], &row[1..4]].concat()),
            no_keys,
            WHOLE,
        ),
        (
            "numbered quaternion",
            with("time_s,x_mm,y_mm,z_mm,q1,q2,q3,q4", scalar_last),
            no_keys,
            Refused("motion.columns = ["),
        ),
        (
            "numbered quaternion, named",
            with("time_s,x_mm,y_mm,z_mm,q1,q2,q3,q4", scalar_last),
            |config| config.columns = Some(named("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw")),
            WHOLE,
        ),
        (
            "signals",
            with(&format!("{POSES},emg_uv,vx_mm_s"), |row| [row, &[7.0, 3.0]].concat()),
            no_keys,
            WHOLE,
        ),
        ("metres", with("time_s,x_m,y_m,z_m,qw,qx,qy,qz", scaled(1.0, 1e-3)), no_keys, WHOLE),
        (
            "line of units",
            with("Time,X,Y,Z,qw,qx,qy,qz\ns,cm,cm,cm,-,-,-,-", scaled(1.0, 0.1)),
            no_keys,
            WHOLE,
        ),
    ]
}

/// Headers with something left open.
fn short_headers() -> Vec<Case> {
    vec![
        ("no units", with("t,x,y,z,qw,qx,qy,qz", same), no_keys, Refused("motion.time_unit = \"s\"")),
        (
            "no unit of length",
            with("time_s,x,y,z,qw,qx,qy,qz", same),
            no_keys,
            Refused("motion.length_unit = "),
        ),
        (
            "units by keys",
            with("t,x,y,z,qw,qx,qy,qz", scaled(1e3, 1e-3)),
            |config| (config.time_unit, config.length_unit) = (Some(TimeUnit::Ms), Some(LengthUnit::M)),
            WHOLE,
        ),
        ("no header", text_of("", &cells(&poses()), ","), no_keys, Refused("motion.columns = [")),
        (
            "no header, named",
            text_of("", &cells(&poses()), ","),
            |config| config.columns = Some(named(POSES)),
            WHOLE,
        ),
        (
            "unknown names",
            with("Zeit_s,vorn_mm,links_mm,oben_mm,a,b,c,d", same),
            no_keys,
            Refused("motion.columns = ["),
        ),
        (
            "unknown names, named",
            with("Zeit_s,vorn_mm,links_mm,oben_mm,a,b,c,d", same),
            |config| config.columns = Some(named(POSES)),
            WHOLE,
        ),
        (
            "two bodies",
            with("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz,x_mm", |row| [row, &[1.0]].concat()),
            no_keys,
            Refused("motion.columns = ["),
        ),
    ]
}

fn rotations() -> Vec<Case> {
    vec![
        (
            "angles",
            with("time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", degrees),
            no_keys,
            Refused("motion.euler_order = \"XYZ\""),
        ),
        (
            "angles in an order",
            with("time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", degrees),
            euler,
            WHOLE,
        ),
        (
            "angles without a unit",
            with("time_s,x_mm,y_mm,z_mm,rx,ry,rz", radians),
            euler,
            Refused("motion.angle_unit = "),
        ),
        (
            "angles about fixed axes",
            with("time_s,x_mm,y_mm,z_mm,rx,ry,rz", fixed),
            |config| (config.angle_unit, config.euler_order) = (Some(AngleUnit::Rad), Some("xyz".to_owned())),
            WHOLE,
        ),
        (
            "an order that is none",
            with("time_s,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad", radians),
            |config| config.euler_order = Some("xyx".to_owned()),
            Refused("motion.euler_order is 'xyx'"),
        ),
        (
            "an order without a use",
            separated(",", "."),
            euler,
            Refused("motion.euler_order is for files with three angles"),
        ),
        (
            "a matrix without a unit",
            with(&matrix_header(1, 4), |row| matrix(row, false)),
            no_keys,
            Refused("motion.length_unit = "),
        ),
        (
            "matrix 4×4",
            with(&matrix_header(1, 4), |row| matrix(row, false)),
            |config| config.length_unit = Some(LengthUnit::Mm),
            WHOLE,
        ),
        (
            "matrix 3×4 from 0",
            with(&matrix_header(0, 3), |row| matrix(row, false)[..13].to_vec()),
            |config| config.length_unit = Some(LengthUnit::Mm),
            WHOLE,
        ),
        (
            "matrix by columns",
            with(&matrix_header(1, 4), |row| matrix(row, true)),
            |config| config.length_unit = Some(LengthUnit::Mm),
            Refused("by motion.columns"),
        ),
        (
            "no turn",
            with("time_s,x_mm,y_mm,z_mm", |row| row[..4].to_vec()),
            no_keys,
            Refused("no columns of an orientation"),
        ),
    ]
}

fn times() -> Vec<Case> {
    vec![
        ("milliseconds", with(&POSES.replace("time_s", "time_ms"), scaled(1e3, 1.0)), no_keys, WHOLE),
        (
            "milliseconds as seconds",
            with(POSES, scaled(1e3, 1.0)),
            no_keys,
            Refused("motion.time_unit = \"ms\""),
        ),
        (
            "milliseconds by the key",
            with(POSES, scaled(1e3, 1.0)),
            |config| config.time_unit = Some(TimeUnit::Ms),
            WHOLE,
        ),
        (
            "seconds as microseconds",
            with(&POSES.replace("time_s", "time_us"), same),
            no_keys,
            Refused("motion.time_unit = \"s\""),
        ),
        (
            "microseconds as seconds",
            with(POSES, scaled(1e6, 1.0)),
            no_keys,
            Refused("motion.time_unit = \"us\""),
        ),
        ("clock", clock(36_000.0), no_keys, WHOLE),
        (
            "clock with a unit",
            clock(36_000.0),
            |config| config.time_unit = Some(TimeUnit::Ms),
            Refused("motion.time_unit is for times in numbers"),
        ),
        ("clock over midnight", clock(86_399.5), no_keys, WHOLE),
        ("frames", with("Frame,x_mm,y_mm,z_mm,qw,qx,qy,qz", frames), no_keys, Refused("motion.rate_hz = ")),
        (
            "frames at a rate",
            with("Frame,x_mm,y_mm,z_mm,qw,qx,qy,qz", frames),
            |config| config.rate_hz = Some(RATE_HZ),
            WHOLE,
        ),
        (
            "no time",
            with(&POSES[7..], |row| row[1..].to_vec()),
            |config| config.rate_hz = Some(RATE_HZ),
            WHOLE,
        ),
    ]
}

fn losses() -> Vec<Case> {
    vec![
        (
            "empty cells",
            lost(|row| row[1..].iter_mut().for_each(String::clear)),
            no_keys,
            Read(Plain::Poses, 5),
        ),
        ("NaN", lost(|row| row[3] = "NaN".to_owned()), no_keys, Read(Plain::Poses, 5)),
        ("dashes", lost(|row| row[4] = "-".to_owned()), no_keys, Read(Plain::Poses, 5)),
        (
            "zero quaternion",
            lost(|row| row[4..].iter_mut().for_each(|cell| *cell = "0".to_owned())),
            no_keys,
            Read(Plain::Poses, 5),
        ),
        (
            "rows of empty cells, at the end too",
            lost(|row| row.iter_mut().for_each(String::clear)) + ",,,,,,,\n,,,,,,,\n",
            no_keys,
            Read(Plain::Poses, 5),
        ),
        (
            "rows of empty cells without times",
            without_times(","),
            |config| config.rate_hz = Some(RATE_HZ),
            Read(Plain::Poses, 5),
        ),
        (
            "rows of tabs without times",
            without_times("\t"),
            |config| config.rate_hz = Some(RATE_HZ),
            Read(Plain::Poses, 5),
        ),
        (
            "a word",
            lost(|row| row[2] = "lost?".to_owned()),
            no_keys,
            Refused(":42: column 3 'y_mm' is 'lost?'"),
        ),
    ]
}

fn heads() -> Vec<Case> {
    vec![
        ("preamble", format!("{PREAMBLE}{}", separated(",", ".")), no_keys, WHOLE),
        ("preamble, semicolon", format!("{PREAMBLE}{}", separated(";", ",")), no_keys, WHOLE),
        ("comments", format!("# Patient 7\n\n{}", separated(",", ".")), no_keys, WHOLE),
        ("MOT in degrees", mot("yes", 1.0_f64.to_degrees()), euler, WHOLE),
        ("STO in radians", mot("no", 1.0), euler, WHOLE),
        (
            "MOT in a plane",
            mot("yes", 1.0).replace("jaw_tz", "jaw_a").replace("jaw_rx", "jaw_b"),
            no_keys,
            Refused("'jaw_tx', 'jaw_ty', 'jaw_ry', 'jaw_rz' are only a part of a pose"),
        ),
        ("MOT without an order", mot("yes", 1.0_f64.to_degrees()), no_keys, Refused("motion.euler_order")),
        ("TRC", trc("mm", 1.0), no_keys, Read(Plain::Markers(3), 0)),
        ("TRC in metres", trc("m", 1e-3), no_keys, Read(Plain::Markers(3), 0)),
    ]
}

fn of_markers() -> Vec<Case> {
    let plain = |count: usize| text_of(&marker_header(count), &cells(&markers(count)), ",");
    let changed = |count: usize, change: fn(usize, &mut Vec<String>)| {
        let mut rows = cells(&markers(count));
        rows.iter_mut().enumerate().for_each(|(index, row)| change(index, row));
        text_of(&marker_header(count), &rows, ",")
    };
    let lose: fn(usize, &mut Vec<String>) = |row, cells| {
        if (30..35).contains(&row) {
            cells[4..7].iter_mut().for_each(String::clear);
        }
    };
    let at_origin: fn(usize, &mut Vec<String>) = |row, cells| {
        if (30..35).contains(&row) {
            cells[4..7].iter_mut().for_each(|cell| *cell = "0.000".to_owned());
        }
    };
    let swap: fn(usize, &mut Vec<String>) = |row, cells| {
        if (30..35).contains(&row) {
            (1..4).for_each(|axis| cells.swap(axis, 3 + axis));
        }
    };
    let still: fn(usize, &mut Vec<String>) = |_, cells| {
        for (cell, number) in cells[10..13].iter_mut().zip(["160", "210", "333"]) {
            number.clone_into(cell);
        }
    };
    let vicon = "Trajectories\n100\n,,jaw:LI,,,jaw:RM,,,jaw:LM,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm,mm,mm,mm";
    let frames = |(frame, row): (usize, &Vec<f64>)| [&[frame as f64 + 1.0, 0.0], &row[1..]].concat();
    let frames: Vec<Vec<f64>> = markers(3).iter().enumerate().map(frames).collect();
    let named = |names: [&str; 3]| {
        let columns = names.map(|name| ["X", "Y", "Z"].map(|axis| format!(";{name}.{axis} [mm]")).concat());
        text_of(&format!("Zeit [s]{}", columns.concat()), &cells(&markers(3)), ";").replace('.', ",")
    };
    vec![
        ("three markers", plain(3), no_keys, Read(Plain::Markers(3), 0)),
        ("four markers", plain(4), no_keys, Read(Plain::Markers(4), 0)),
        ("twelve markers", plain(12), no_keys, Read(Plain::Markers(12), 0)),
        ("two markers", plain(2), no_keys, Refused("time_s,m1_x_mm,m1_y_mm,m1_z_mm")),
        ("named markers", named(["Front", "Right", "Left"]), no_keys, Read(Plain::Markers(3), 0)),
        (
            "markers in two lines",
            text_of(vicon, &cells(&frames), ","),
            |config| config.rate_hz = Some(RATE_HZ),
            Read(Plain::Markers(3), 0),
        ),
        ("one of three lost", changed(3, lose), no_keys, Read(Plain::Markers(3), 5)),
        ("one of four lost", changed(4, lose), no_keys, Read(Plain::Markers(4), 0)),
        ("lost to the origin", changed(3, at_origin), no_keys, Read(Plain::Markers(3), 5)),
        ("swapped", changed(3, swap), no_keys, Read(Plain::Markers(3), 0)),
        ("one of the head", changed(4, still), no_keys, Refused("motion.markers = [\"m1\", \"m2\", \"m3\"]")),
        (
            "without the one of the head",
            changed(4, still),
            |config| config.markers = Some(["m1", "m2", "m3"].map(str::to_owned).to_vec()),
            Read(Plain::Markers(3), 0),
        ),
        (
            "a marker that is not there",
            plain(3),
            |config| config.markers = Some(vec!["m9".to_owned()]),
            Refused("motion.markers names 'm9'; the file's markers are m1, m2, m3"),
        ),
        (
            "half a marker",
            plain(3).replacen("m3_z_mm", "other", 1),
            no_keys,
            Refused("marker 'm3' has no column for z"),
        ),
    ]
}

/// Forms in other code pages, and a form of bytes.
fn bytes() -> Vec<(&'static str, Vec<u8>, Keys, Expected)> {
    let text = separated(";", ",")
        .replacen("qz", "qz;EMG µV", 1)
        .replace('\n', ";1\n")
        .replacen("µV;1\n", "µV\n", 1);
    let windows = text.chars().map(|c| c as u8).collect();
    let named = |place: Vec<f64>| place[1..].to_vec();
    let places: Vec<Vec<f64>> = markers(3).into_iter().map(named).collect();
    let c3d = c3d::tests::file(&["LI", "RM", "LM"], RATE_HZ as f32, &places, c3d::tests::Numbers::Floats);
    vec![
        ("UTF-8 with a mark", ["\u{feff}", &text].concat().into_bytes(), no_keys, WHOLE),
        ("UTF-16, little end first", utf_16(&text, u16::to_le_bytes), no_keys, WHOLE),
        ("UTF-16, big end first", utf_16(&text, u16::to_be_bytes), no_keys, WHOLE),
        ("Windows-1252", windows, no_keys, WHOLE),
        (
            "C3D cut short",
            c3d[..c3d.len() - 60].to_vec(),
            no_keys,
            Refused("cut short at frame 126 of 7 to 126"),
        ),
        ("C3D", c3d, no_keys, Read(Plain::Floats(3), 0)),
    ]
}

/// The first difference of rows from those of the plain form, but for the gaps.
fn difference(table: &Table, plain: Plain, gaps: usize) -> Option<String> {
    let expected = match plain {
        Plain::Poses => poses(),
        Plain::Markers(count) | Plain::Floats(count) => markers(count),
    };
    if table.rows.len() != expected.len() - gaps {
        return Some(format!("{} rows", table.rows.len()));
    }
    let near = if let Plain::Floats(_) = plain { NEAR_FLOAT } else { NEAR };
    let begin_s = table.rows[0].time_s;
    table.rows.iter().find_map(|row| {
        let time_s = row.time_s - begin_s;
        let expected = &expected[(time_s * RATE_HZ).round() as usize];
        let both = [time_s].into_iter().chain(row.values.iter().copied()).zip(expected);
        let mut off = both.filter(|(value, expected)| !value.is_nan() && (value - *expected).abs() > near);
        off.next().map(|(value, expected)| format!("line {}: {value} for {expected}", row.line))
    })
}

/// What is wrong with the answer to a file; nothing if it is as expected.
fn wrong(path: &Path, keys: Keys, expected: Expected) -> Option<String> {
    let mut config = FileConfig::new(path);
    keys(&mut config);
    let jaw = JawConfig::default();
    let read = Source::read(&config, &jaw).and_then(|source| {
        source.recording(&source.samples()?)?;
        Ok(source.table)
    });
    match (read, expected) {
        (Ok(table), Read(plain, gaps)) => difference(&table, plain, gaps).or_else(|| {
            // The plain form is read again as the same rows.
            match Table::parse(&table.plain(path), &FileConfig::new(path)) {
                Ok(again) => difference(&again, plain, gaps),
                Err(error) => Some(format!("its plain form is refused: {}", error.problem)),
            }
        }),
        (Err(error), Refused(part)) if error.to_string().contains(part) => None,
        (Ok(table), Refused(part)) => Some(format!("not refused for {part}: {:?}", table.protocol)),
        (Err(error), _) => Some(error.to_string()),
    }
}

#[test]
fn every_form_of_a_tracker_is_read_as_the_plain_form_or_refused_with_the_key_that_helps() {
    let texts =
        [separators(), headers(), short_headers(), rotations(), times(), losses(), heads(), of_markers()]
            .concat();
    let texts =
        texts.into_iter().map(|(name, text, keys, expected)| (name, text.into_bytes(), keys, expected));
    let forms: Vec<_> = texts.chain(bytes()).collect();
    assert!(forms.len() > 80, "{}", forms.len());
    let path = std::env::temp_dir().join(format!("masseter-messy-{}.csv", std::process::id()));
    let all_wrong = forms.into_iter().filter_map(|(name, bytes, keys, expected)| {
        fs::write(&path, bytes).unwrap();
        wrong(&path, keys, expected).map(|wrong| format!("{name}: {wrong}"))
    });
    let all_wrong: Vec<_> = all_wrong.collect();
    fs::remove_file(&path).unwrap();
    assert!(all_wrong.is_empty(), "{}", all_wrong.join("\n"));
}
