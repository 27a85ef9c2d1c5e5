//! `masseter bench` as its users meet it.

use std::fs;
use std::process::Command;

use data_encoding::BASE64;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::Deserializer;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use serde_json::Value;

use crate::common::{Cores, MASSETER};

#[test]
fn the_bench_of_the_loop_leaves_its_results_and_a_histogram_of_every_candidate() {
    let _cores = Cores::take();
    let place = tempfile::tempdir().unwrap();
    let output = Command::new(MASSETER)
        .args(["bench", "loop", "--rounds", "1", "--format", "json", "--out"])
        .arg(place.path())
        .output()
        .unwrap();
    // The machine may be too disturbed for a bench.
    assert!(matches!(output.status.code(), Some(0 | 3)), "{output:?}");
    let results: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.stdout, fs::read(place.path().join("results.json")).unwrap());
    assert_eq!(results["disturbed"], output.status.code() == Some(3), "{results}");
    let candidates = results["candidates"].as_array().unwrap();
    assert_eq!(candidates[0]["name"], "masseter");
    for candidate in candidates {
        let name = candidate["name"].as_str().unwrap();
        let log = format!("loop-{}.hlog", name.replace(|c: char| !c.is_ascii_alphanumeric(), "-"));
        assert!(samples(&fs::read(place.path().join(log)).unwrap()) >= 10_000, "{name}");
        let percentiles = candidate["percentiles"].as_array().unwrap();
        let names: Vec<_> =
            percentiles.iter().map(|percentile| percentile["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["p50", "p99", "p99.9", "max"], "{name}");
    }
}

/// The number of samples in all intervals of a histogram log.
fn samples(log: &[u8]) -> u64 {
    let of_interval = |entry| {
        let LogEntry::Interval(interval) = entry else { return 0 };
        let bytes = BASE64.decode(interval.encoded_histogram().as_bytes()).unwrap();
        let histogram: Histogram<u64> = Deserializer::new().deserialize(&mut bytes.as_slice()).unwrap();
        histogram.len()
    };
    IntervalLogIterator::new(log).map(|entry| of_interval(entry.unwrap())).sum()
}
