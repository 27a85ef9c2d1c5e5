//! Writes the files that are attached to a recording.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use anyhow::{Context, ensure};
use mcap::Attachment;

/// Writes all of them into a new folder. Returns their names and lengths, bytes. Refuses names that lead out of the folder.
pub(super) fn write<'a>(
    attachments: &'a [Attachment<'static>],
    folder: &Path,
) -> anyhow::Result<Vec<(&'a str, usize)>> {
    ensure!(!attachments.is_empty(), "no file is attached to the recording");
    for Attachment { name, .. } in attachments {
        let is_plain = Path::new(name).file_name() == Some(OsStr::new(name));
        ensure!(is_plain, "a file is attached as '{name}', which is not the plain name of a file");
    }
    fs::create_dir(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let write = |file: &'a Attachment<'static>| {
        let path = folder.join(&file.name);
        let written = File::create_new(&path).and_then(|mut created| created.write_all(&file.data));
        written.with_context(|| format!("cannot write {}", path.display()))?;
        Ok((file.name.as_str(), file.data.len()))
    };
    attachments.iter().map(write).collect()
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::*;

    #[test]
    fn no_name_leads_out_of_the_folder_and_nothing_is_written_then() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new");
        let attached = |name: &str| Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: String::new(),
            data: Cow::Borrowed(b"any"),
        };
        for name in ["", ".", "..", "/etc/any", "../any", "any/", "any/..", "a/b"] {
            let error = write(&[attached("good"), attached(name)], &folder).unwrap_err().to_string();
            assert!(error.contains(&format!("'{name}'")), "{error}");
            assert!(!folder.exists(), "{name}");
        }
        assert_eq!(write(&[attached("good")], &folder).unwrap(), [("good", 3)]);
        assert_eq!(fs::read(folder.join("good")).unwrap(), b"any");
    }
}
