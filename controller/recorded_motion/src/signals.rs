//! Columns of a recording beside the motion as signals over the motion's time.
//!
//! A value holds from its row to the next one. A lost sample is no value, and nothing is interpolated.

use std::sync::Arc;

use masseter_scenario::{FileConfig, JawConfig};

use super::{TrajectoryError, import::Source, table::LARGEST_GAP_S};

/// Largest difference of times by rounding, s.
const SAME_TIME_S: f64 = 1e-6;

/// A column of the recording beside the motion.
#[derive(Debug, Clone)]
pub struct RecordedSignal {
    /// Such as `recorded.emg`.
    pub name: String,
    /// As the file states it in brackets; empty without one.
    pub unit: String,
    /// The name of its column.
    pub column: String,
    /// Since the motion's first row, s.
    time_s: Arc<[f64]>,
    values: Vec<f64>,
}

impl RecordedSignal {
    /// The value of the latest row at a time of the motion, s; none where it is lost.
    #[inline]
    pub fn at(&self, motion_s: f64) -> Option<f64> {
        let next = self.time_s.partition_point(|time_s| *time_s <= motion_s + SAME_TIME_S);
        let row = next.checked_sub(1)?;
        let is_held = motion_s - self.time_s[row] <= LARGEST_GAP_S;
        Some(self.values[row]).filter(|value| is_held && value.is_finite())
    }
}

/// The signals that a file holds beside its motion.
///
/// # Errors
/// For an unusable file: the line, the reason and a remedy.
pub fn recorded_signals(
    config: &FileConfig,
    jaw: &JawConfig,
) -> Result<Vec<RecordedSignal>, TrajectoryError> {
    let table = Source::read(config, jaw)?.table;
    let (extras, begin_s) = (&table.extras, table.rows[0].time_s);
    let time_s: Arc<[f64]> = extras.rows.iter().map(|row| row.time_s - begin_s).collect();
    let signal = |(at, column): (usize, &String)| {
        let (name, unit) = extras.signal_name(at);
        let values = extras.rows.iter().map(|row| row.values[at]).collect();
        RecordedSignal { name, unit, column: column.clone(), time_s: time_s.clone(), values }
    };
    Ok(extras.names.iter().enumerate().map(signal).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const HEAD: &str = "time_s;x_mm;y_mm;z_mm;qw;qx;qy;qz;EMG left [µV];emg-left;Note;7";

    /// Ten rows from 5 s on, 10 ms apart; the pose of row 3 and the first signal of row 5 are lost.
    fn read() -> (Vec<RecordedSignal>, Vec<String>, String) {
        let row = |row: usize| {
            let (x, emg) = (if row == 3 { "" } else { "0,1" }, if row == 5 { "NaN" } else { "1,5" });
            let note = if row == 4 { "swallows" } else { "" };
            format!("\n5,{row:02};{x};0;0;1;0;0;0;{emg};{row};{note};{row}")
        };
        let text = HEAD.to_owned() + &(0..10).map(row).collect::<String>();
        // Tests run in threads of one process.
        let owner = (std::process::id(), std::thread::current().id());
        let path = std::env::temp_dir().join(format!("masseter-signals-{owner:?}.csv"));
        fs::write(&path, text).unwrap();
        let (config, jaw) = (FileConfig::new(&path), JawConfig::default());
        let table = Source::read(&config, &jaw).unwrap().table;
        let signals = recorded_signals(&config, &jaw).unwrap();
        fs::remove_file(&path).unwrap();
        (signals, table.protocol.clone(), table.plain(&path))
    }

    #[test]
    fn columns_beside_the_motion_are_signals_in_its_time_and_lost_samples_have_no_value() {
        let (signals, protocol, _) = read();
        let names: Vec<_> =
            signals.iter().map(|signal| (signal.name.as_str(), signal.unit.as_str())).collect();
        assert_eq!(
            names,
            [("recorded.emg_left", "µV"), ("recorded.emg_left_2", ""), ("recorded.column_7", "")]
        );
        let [emg, count, _] = &signals[..] else { panic!("{signals:?}") };
        for (motion_s, value) in
            [(-0.001, None), (0.0, Some(1.5)), (0.049, Some(1.5)), (0.05, None), (0.06, Some(1.5))]
        {
            assert_eq!(emg.at(motion_s), value, "{motion_s}");
        }
        assert_eq!(
            [0.03, 0.035, 0.09, 0.3, 0.4].map(|motion_s| count.at(motion_s)),
            [Some(3.0), Some(3.0), Some(9.0), Some(9.0), None]
        );
        let part =
            "signals from 3 columns: recorded.emg_left (1 lost), recorded.emg_left_2, recorded.column_7";
        assert!(protocol.contains(&part.to_owned()), "{protocol:?}");
        assert!(protocol.contains(&"not used: 'Note' (no number in line 6)".to_owned()), "{protocol:?}");
    }

    #[test]
    fn the_plain_form_keeps_the_columns_also_where_a_pose_is_lost() {
        let (signals, _, plain) = read();
        let rows: Vec<&str> = plain.lines().filter(|line| !line.starts_with('#')).collect();
        assert_eq!(rows[0], "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz,EMG left [µV],emg-left,7");
        assert_eq!((rows[1], rows[4]), ("5,0.1,0,0,1,0,0,0,1.5,0,0", "5.03,,,,,,,,1.5,3,3"));
        assert!(rows[6].ends_with(",,5,5"), "{}", rows[6]);
        let path = std::env::temp_dir().join(format!("masseter-plain-signals-{}.csv", std::process::id()));
        fs::write(&path, plain).unwrap();
        let again = recorded_signals(&FileConfig::new(&path), &JawConfig::default()).unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!(again.len(), signals.len());
        for (again, signal) in again.iter().zip(&signals) {
            assert_eq!((&again.name, &again.unit), (&signal.name, &signal.unit));
            for step in 0..100 {
                let motion_s = f64::from(step) / 1e3;
                assert_eq!(again.at(motion_s), signal.at(motion_s), "{} {motion_s}", signal.name);
            }
        }
    }
}
