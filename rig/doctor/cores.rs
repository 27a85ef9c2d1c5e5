//! The two cores that are best kept for a rig.

use crate::machine::SystemRoot;

/// The last core, and the last one that does not share its arithmetic units.
pub(super) fn to_spare(root: &SystemRoot) -> Option<[usize; 2]> {
    let mut cores: Vec<usize> =
        root.core_folders().iter().filter_map(|name| name.strip_prefix("cpu")?.parse().ok()).collect();
    cores.sort_unstable();
    let last = cores.pop()?;
    let siblings = siblings(root, last);
    let other = cores.into_iter().rfind(|core| !siblings.contains(core))?;
    Some([other, last])
}

/// The cores that share a physical one with `core`.
fn siblings(root: &SystemRoot, core: usize) -> Vec<usize> {
    let path = format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list");
    parse(&root.text(&path).unwrap_or_default())
}

/// A list as the kernel writes it: `0,4-6`.
fn parse(list: &str) -> Vec<usize> {
    let range = |part: &str| -> Option<std::ops::RangeInclusive<usize>> {
        let (from, to) = part.split_once('-').unwrap_or((part, part));
        Some(from.parse().ok()?..=to.parse().ok()?)
    };
    list.split(',').filter_map(range).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::fixture::Fixture;

    #[test]
    fn cores_of_one_physical_core_are_not_taken_for_two() {
        let of = |siblings: &[&str]| {
            let path = |core| format!("sys/devices/system/cpu/cpu{core}/topology/thread_siblings_list");
            let paths: Vec<_> = (0..siblings.len()).map(path).collect();
            let files: Vec<_> = paths.iter().map(String::as_str).zip(siblings.iter().copied()).collect();
            to_spare(&Fixture::of(&files).root())
        };
        assert_eq!(of(&["0-1", "0-1", "2-3", "2-3"]), Some([1, 3]));
        assert_eq!(of(&["0,2", "1,3", "0,2", "1,3"]), Some([2, 3]));
        assert_eq!(of(&["", "", "", ""]), Some([2, 3]), "siblings not told");
        assert_eq!(of(&["0-1", "0-1"]), None);
        let twelve: Vec<_> = (0..12).map(|core| core.to_string()).collect();
        let twelve: Vec<_> = twelve.iter().map(String::as_str).collect();
        assert_eq!(of(&twelve), Some([10, 11]), "counted, not spelled");
    }
}
