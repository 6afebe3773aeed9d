//! Suggests the valid name nearest to an unknown one, for error messages.

/// A clause for a message: the nearest valid name, or the valid names.
pub fn hint(wrong: &str, valid: &[&str]) -> String {
    if let Some(name) = nearest(wrong, valid) {
        return format!("did you mean `{name}`?");
    }
    const SHOWN: usize = 12;
    let given = valid.iter().filter(|n| !n.is_empty());
    let mut names: Vec<String> = given.take(SHOWN).map(|n| format!("`{n}`")).collect();
    names.dedup();
    if valid.len() > SHOWN {
        names.push(format!("... ({} in all)", valid.len()));
    }
    match names.is_empty() {
        true => "there are none".to_string(),
        false => format!("valid: {}", names.join(", ")),
    }
}

/// The valid name with the fewest edits, if it is close enough.
pub fn nearest<'a>(wrong: &str, valid: &[&'a str]) -> Option<&'a str> {
    let wrong = plain(wrong);
    let best = valid.iter().map(|name| (edits(&wrong, &plain(name)), *name)).min_by_key(|(d, _)| *d);
    match best {
        Some((distance, name)) if distance <= (wrong.chars().count() / 3).max(1) => Some(name),
        _ => valid.iter().copied().find(|name| contains_part(name, &wrong)),
    }
}

/// Case, spaces and hyphens are the most frequent mistakes and count nothing.
fn plain(name: &str) -> String {
    name.chars().take(64).map(|c| if c == ' ' || c == '-' { '_' } else { c }).flat_map(char::to_lowercase).collect()
}

fn contains_part(name: &str, wrong: &str) -> bool {
    wrong.chars().count() >= 3 && name.contains(wrong)
}

/// Insertions, deletions, replacements and swaps of neighbours.
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows: Vec<Vec<usize>> = vec![(0..=b.len()).collect()];
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(rows[i - 2][j - 2] + 1);
            }
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_was_meant() {
        let valid = ["r_elbow", "l_elbow", "r_shoulder", "seat"];
        assert_eq!(nearest("r_elbwo", &valid), Some("r_elbow"));
        assert_eq!(nearest("R-Elbow", &valid), Some("r_elbow"));
        assert_eq!(nearest("shoulder", &valid), Some("r_shoulder"));
        assert_eq!(nearest("seta", &valid), Some("seat"));
        assert_eq!(nearest("knee", &valid), None);
        assert_eq!(nearest("", &valid), None);
        assert_eq!(hint("knee", &valid[..1]), "valid: `r_elbow`");
    }
}
