//! A sample of each target: random bytes, and files of the repository with damage, the same in every run.

use std::fs;
use std::path::Path;

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{can_codecs, forward_kinematics, motion_csv, recording, scenario};

const INPUTS: u64 = 300;
const LONGEST_BYTES: usize = 4096;

fn feed_sample(feed: fn(&[u8]), files: &[Vec<u8>]) {
    for seed in 0..INPUTS {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut bytes = vec![0; random.random_range(0..=LONGEST_BYTES)];
        random.fill_bytes(&mut bytes);
        feed(&bytes);
        if !files.is_empty() {
            feed(&damaged(&files[random.random_range(0..files.len())], &mut random));
        }
    }
}

/// A file, cut short now and then, some of whose bytes have become others.
fn damaged(file: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = file.to_vec();
    if random.random_bool(0.2) {
        bytes.truncate(random.random_range(0..=file.len()));
    }
    for _ in 0..random.random_range(0..4) {
        if let Some(last) = bytes.len().checked_sub(1) {
            bytes[random.random_range(0..=last)] = random.random();
        }
    }
    bytes
}

/// The files below a folder of the repository whose names end so.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    fn add(folder: &Path, ending: &str, to: &mut Vec<Vec<u8>>) {
        for entry in fs::read_dir(folder).expect("a folder of the repository") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                add(&path, ending, to);
            } else if path.to_string_lossy().ends_with(ending) {
                to.push(fs::read(path).expect("a file of the repository"));
            }
        }
    }
    let mut found = Vec::new();
    add(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder), ending, &mut found);
    assert!(!found.is_empty(), "no {ending} in {folder}");
    // The order of a folder differs between machines.
    found.sort();
    found
}

#[test]
fn messages_of_any_bytes_are_read_or_refused() {
    feed_sample(can_codecs::feed, &[]);
}

#[test]
fn forward_kinematics_of_any_bytes_are_certified_or_refused() {
    feed_sample(forward_kinematics::feed, &[]);
}

#[test]
fn motion_files_of_any_bytes_are_played_or_refused() {
    feed_sample(motion_csv::feed, &files("examples", ".csv"));
}

#[test]
fn recordings_of_any_bytes_are_read_or_refused() {
    feed_sample(recording::feed, &files("tests/golden", ".mcap"));
}

#[test]
fn scenarios_of_any_bytes_are_read_or_refused() {
    feed_sample(scenario::feed, &files("examples", ".toml"));
}
