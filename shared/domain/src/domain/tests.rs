use std::sync::atomic::{AtomicBool, Ordering};

use super::*;

fn unique(name: &str) -> Domain {
    Domain::named(&format!("test-{name}-{}", std::process::id())).unwrap()
}

fn segment(domain: &Domain) -> PathBuf {
    Path::new(SHARED_MEMORY).join(domain.prefix().unwrap() + "segment")
}

/// Sweeps a dead domain and returns the number of removed files; no file may remain.
fn swept(domain: &Domain) -> usize {
    let swept = domain.sweep().unwrap().unwrap();
    assert!(swept.remaining.is_empty(), "{swept:?}");
    swept.removed
}

#[test]
fn what_cannot_be_removed_is_reported_and_the_rest_removed() {
    let domain = unique("remaining");
    let claim = domain.claim().unwrap();
    let file = segment(&domain);
    let foreign = PathBuf::from(format!("{}-folder", file.display()));
    fs::write(&file, "").unwrap();
    // The removal of a folder as a file fails for every user.
    fs::create_dir(&foreign).unwrap();
    drop(claim);
    let swept = domain.sweep().unwrap().unwrap();
    fs::remove_dir(&foreign).unwrap();
    assert_eq!(swept.removed, 1);
    assert!(
        matches!(&swept.remaining[..], [DomainError::File { path, .. }] if *path == foreign),
        "{swept:?}"
    );
    assert!(!file.exists() && !domain.root().exists());
}

#[test]
fn a_new_claim_has_another_prefix_and_removes_what_the_last_one_left() {
    let domain = unique("again");
    drop(domain.claim().unwrap());
    let (left, prefix) = (segment(&domain), domain.prefix().unwrap());
    fs::write(&left, "").unwrap();
    let claim = domain.claim().unwrap();
    assert!(!left.exists());
    assert_ne!(domain.prefix().unwrap(), prefix);
    drop(claim);
    swept(&domain);
}

#[test]
fn a_file_of_others_is_found_and_does_no_harm() {
    let domain = ScratchDomain::claim("test-foreign").unwrap();
    let own = segment(&domain);
    let foreign = PathBuf::from(format!("{}-x", own.display()));
    fs::write(&own, "").unwrap();
    assert_eq!(domain.foreign_file().unwrap(), None);
    std::os::unix::fs::symlink("/dev/null", &foreign).unwrap();
    assert_eq!(domain.foreign_file().unwrap().as_ref(), Some(&foreign));
    domain.make_private().unwrap();
    domain.check_mapped().unwrap();
    assert_eq!(fs::metadata(&own).unwrap().mode() & 0o777, 0o600);
}

/// iceoryx2 removes its own files during a listing.
#[test]
fn a_file_that_vanishes_is_nobody_elses() {
    let domain = ScratchDomain::claim("test-vanish").unwrap();
    let own = segment(&domain);
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) {
                fs::write(&own, "").unwrap();
                fs::remove_file(&own).unwrap();
            }
        });
        let found: Vec<_> = (0..5000).filter_map(|_| domain.foreign_file().unwrap()).collect();
        is_over.store(true, Ordering::Relaxed);
        assert_eq!(found, Vec::<PathBuf>::new());
    });
}

#[test]
fn memory_whose_file_is_gone_is_told_from_that_of_another_user() {
    let folder = std::env::temp_dir().join(unique("mapped").id());
    fs::create_dir(&folder).unwrap();
    let (own, link) = (folder.join("own"), folder.join("link"));
    fs::write(&own, "").unwrap();
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    let judged = |path: &str, inode: u64| {
        check_mapped_file(&format!("7f00-7f01 rw-s 00000000 00:1a {inode}    {path}"), path)
    };
    let (path, inode) = (own.to_str().unwrap(), fs::metadata(&own).unwrap().ino());
    let (same, other) = (judged(path, inode), judged(path, inode + 1));
    let removed = judged(&format!("{path} (deleted)"), inode);
    let foreign = judged(link.to_str().unwrap(), inode);
    fs::remove_dir_all(&folder).unwrap();
    assert!(same.is_ok(), "{same:?}");
    for gone in [other, removed, judged(path, inode)] {
        assert!(matches!(gone, Err(DomainError::Gone { .. })), "{gone:?}");
    }
    assert!(matches!(foreign, Err(DomainError::Foreign { .. })), "{foreign:?}");
}

#[test]
fn a_claimed_domain_is_alive_refused_to_others_and_not_swept() {
    let domain = unique("claim");
    let claim = domain.claim().unwrap();
    assert!(domain.is_alive().unwrap());
    assert!(matches!(domain.claim(), Err(DomainError::InUse { .. })));
    assert!(domain.sweep().unwrap().is_none());
    assert!(domain.root().exists());
    drop(claim);
    assert!(!domain.is_alive().unwrap());
    assert_eq!(swept(&domain), 0);
    assert!(!domain.root().exists());
}

#[test]
fn a_scratch_domain_leaves_nothing_behind() {
    let scratch = ScratchDomain::claim("test-scratch").unwrap();
    let domain = (*scratch).clone();
    let file = segment(&domain);
    fs::write(&file, "").unwrap();
    assert!(domain.is_alive().unwrap());
    drop(scratch);
    assert!(!file.exists() && !domain.root().exists());
}

#[test]
fn a_domain_whose_id_begins_another_ones_leaves_it_its_files() {
    let (short, long) = (unique("prefix"), Domain::named(&format!("{}_2", unique("prefix").id())).unwrap());
    let claim = long.claim().unwrap();
    let file = segment(&long);
    fs::write(&file, "").unwrap();
    assert_eq!(swept(&short), 0);
    assert!(file.exists());
    drop(claim);
    assert_eq!(swept(&long), 1);
}

#[test]
fn a_permanent_sweep_never_removes_a_domain_that_is_being_claimed() {
    let domain = unique("race");
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) {
                domain.sweep().unwrap();
            }
        });
        for _ in 0..500 {
            let claim = domain.claim();
            let is_whole = claim.is_ok() && domain.root().join(LOCK).exists() && domain.is_alive().unwrap();
            if !is_whole {
                is_over.store(true, Ordering::Relaxed);
            }
            assert!(is_whole, "{claim:?}");
        }
        is_over.store(true, Ordering::Relaxed);
    });
    domain.sweep().unwrap();
}

#[test]
fn names_that_could_leave_their_folder_are_refused() {
    for id in ["", "..", "a/b", "a b", &"x".repeat(33)] {
        assert!(matches!(Domain::named(id), Err(DomainError::BadName { .. })), "{id}");
    }
}
