//! The choice of two cores to isolate for a rig.

use crate::machine::SystemRoot;

/// The last core, and the last other one on another physical core.
pub(super) fn to_spare(root: &SystemRoot) -> Option<[usize; 2]> {
    let mut cores = root.online_cores();
    let last = cores.pop()?;
    let siblings = siblings(root, last);
    let other = cores.into_iter().rfind(|core| !siblings.contains(core))?;
    Some([other, last])
}

/// The logical cores on the same physical core.
fn siblings(root: &SystemRoot, core: usize) -> Vec<usize> {
    root.cores(&format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn cores_of_one_physical_core_are_not_taken_for_two() {
        let of = |siblings: &[&str]| {
            let online = format!("0-{}", siblings.len() - 1);
            let path = |core| format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list");
            let paths: Vec<_> = (0..siblings.len()).map(path).collect();
            let mut files: Vec<_> = paths.iter().map(String::as_str).zip(siblings.iter().copied()).collect();
            files.push(("sys/devices/system/cpu/online", &online));
            to_spare(&Fixture::with_files(&files).root())
        };
        assert_eq!(of(&["0-1", "0-1", "2-3", "2-3"]), Some([1, 3]));
        assert_eq!(of(&["0,2", "1,3", "0,2", "1,3"]), Some([2, 3]));
        assert_eq!(of(&["", "", "", ""]), Some([2, 3]), "siblings not told");
        assert_eq!(of(&["0-1", "0-1"]), None);
    }

    #[test]
    fn cores_that_are_offline_are_not_spared() {
        let smt_off = [
            ("sys/devices/system/cpu/online", "0,2,4,6"),
            ("sys/devices/system/cpu/cpu6/topology/thread_siblings_list", "6"),
            ("sys/devices/system/cpu/cpu7/online", "0"),
        ];
        assert_eq!(to_spare(&Fixture::with_files(&smt_off).root()), Some([4, 6]));
    }
}
