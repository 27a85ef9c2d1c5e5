//! Parts of sentences that many messages share.

/// Bytes of the longest name with a suggestion.
const LONGEST: usize = 200;
/// Least similarity of a suggestion.
const LIKELY: f64 = 0.7;

/// A number of things, with the noun in singular or plural.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::counted;
///
/// assert_eq!(counted(1, "cycle"), "1 cycle");
/// assert_eq!(counted(0, "box"), "0 boxes");
/// ```
pub fn counted(number: u64, noun: &str) -> String {
    let ending = match number {
        1 => "",
        _ if noun.ends_with(['x', 'h']) => "es",
        _ => "s",
    };
    format!("{number} {noun}{ending}")
}

/// Things behind each other, with commas between them.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::listed;
///
/// assert_eq!(listed([1, 2, 3]), "1, 2, 3");
/// ```
pub fn listed<T: ToString>(things: impl IntoIterator<Item = T>) -> String {
    things.into_iter().map(|thing| thing.to_string()).collect::<Vec<_>>().join(", ")
}

/// A number with its digits in groups of three.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::grouped;
///
/// let numbers = [0, 7, 999, 1000, 11_379, 1_234_567];
/// assert_eq!(numbers.map(grouped), ["0", "7", "999", "1,000", "11,379", "1,234,567"]);
/// ```
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    let (head, rest) = digits.split_at(first);
    let groups = (0..rest.len() / 3).map(|group| &rest[3 * group..3 * group + 3]);
    [head].into_iter().filter(|head| !head.is_empty()).chain(groups).collect::<Vec<_>>().join(",")
}

/// The shortest text that parses to the same number. Numbers below 1e-5 and from 1e16 on have an exponent.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::shortest;
///
/// assert_eq!(shortest(0.268), "0.268");
/// assert_eq!(shortest(-5.23707e-18), "-5.23707e-18");
/// assert_eq!(shortest(0.0), "0");
/// ```
pub fn shortest(number: f64) -> String {
    let is_plain = number == 0.0 || !number.is_finite() || (1e-5..1e16).contains(&number.abs());
    if is_plain { number.to_string() } else { format!("{number:e}") }
}

/// The most similar of the names to an unknown name, without regard to case; none without a similar name.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::nearest;
///
/// let topics = ["reading", "command", "state"];
/// assert_eq!(nearest("States", topics), Some("state"));
/// assert_eq!(nearest("jaw", topics), None);
/// ```
pub fn nearest<'a>(unknown: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if unknown.len() > LONGEST {
        return None;
    }
    let unknown = unknown.to_lowercase();
    let rated = names.into_iter().map(|name| (strsim::jaro_winkler(&unknown, name), name));
    let likely = rated.filter(|(likeness, _)| *likeness >= LIKELY);
    likely.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

/// The question "did you mean" with the most similar name, as the end of a sentence; empty without a similar name.
///
/// # Examples
/// ```
/// use masseter_scenario::wording::question;
///
/// assert_eq!(question("stat", ["command", "state"]), "; did you mean 'state'?");
/// assert_eq!(question("jaw", ["command", "state"]), "");
/// ```
pub fn question<'a>(unknown: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(unknown, names).map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"))
}
