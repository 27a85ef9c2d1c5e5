//! The Linux distribution, by its id in `/etc/os-release`.

use crate::machine::SystemRoot;

/// The `ID`, in lower case; none if the file has none.
pub(super) fn id(root: &SystemRoot) -> Option<String> {
    let os_release = root.text("etc/os-release")?;
    let id = os_release.lines().find_map(|line| line.strip_prefix("ID="))?;
    Some(id.trim_matches(['"', '\'']).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn the_id_is_neither_the_versions_nor_that_of_similar_ones() {
        let of = |os_release| id(&Fixture::with_files(&[("etc/os-release", os_release)]).root());
        assert_eq!(of("PRETTY_NAME=\"Debian\"\nVERSION_ID=\"13\"\nID=debian\n").as_deref(), Some("debian"));
        assert_eq!(of("ID_LIKE=debian\nID=ubuntu\n").as_deref(), Some("ubuntu"));
        assert_eq!(of("ID=\"rocky\"\n").as_deref(), Some("rocky"));
        assert_eq!(of("NAME=Linux\n"), None);
        assert_eq!(id(&Fixture::with_files(&[]).root()), None);
    }
}
