use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ZeroCopySend;

use super::*;
use crate::domain::ScratchDomain;
use crate::folder::LONGEST_SESSION_FOLDER;

/// Every file below a folder.
fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            files_below(&path, found);
        } else {
            found.push(path);
        }
    }
}

#[test]
fn no_other_user_may_touch_a_file_of_a_domain_and_every_path_leaves_room_for_a_session_folder() {
    let domain = ScratchDomain::claim("test-of-the-longest-name").unwrap();
    let node = Node::join(&domain).unwrap();
    let _subscriber = frame_inlet(&node).unwrap();
    let publisher = frame_outlet(&node).unwrap();
    publisher.update_connections().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(domain.root()), 0o700);
    assert_eq!(mode(domain.root().parent().unwrap()), 0o700);

    let prefix = domain.prefix().unwrap();
    let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap());
    let shared: Vec<_> =
        shared.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).collect();
    assert!(shared.len() > 3, "{shared:?}");
    for file in shared {
        assert_eq!(mode(&file.path()), 0o600, "{file:?}");
    }
    let mut files = Vec::new();
    files_below(domain.root(), &mut files);
    assert!(!files.is_empty());
    let room = 255 - LONGEST_SESSION_FOLDER - "/masseter/".len() - 32 - 1;
    // Longest parts: the name has 32 bytes, the user's id 10 digits, the node's number 39.
    let longer = (32 - domain.id().len()) + 9 + 15;
    for file in files {
        let beside_the_id = file.strip_prefix(domain.root()).unwrap().as_os_str().len();
        assert!(beside_the_id + longer <= room, "{file:?}");
    }
}

/// An event, except for the name of its layout.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("masseter/Event/0000000000000000")]
struct OtherLayout([u64; size_of::<Event>() / 8]);

#[test]
fn a_topic_of_another_layout_is_not_opened() {
    let domain = ScratchDomain::claim("test-layout").unwrap();
    let node = Node::join(&domain).unwrap();
    let _publisher = Event::outlet(&node).unwrap();
    let other = node.topic::<Event, OtherLayout>(Event::DEPTH).unwrap().open_or_create();
    let error = format!("{:?}", other.unwrap_err());
    assert!(error.contains("Incompatible"), "{error}");
}
