/// The values before and after a time in rows by rising time, and the position of the time between
/// them, from 0 at the first to 1 at the second; `None` outside the rows, and if the two are more
/// than `gap_s` apart. At the time of a row both are that row.
pub(crate) fn surrounding<T>(rows: &[(f64, T)], time: f64, gap_s: f64) -> Option<(&T, &T, f64)> {
    let after = rows.partition_point(|(at, _)| *at < time);
    let (later, to) = rows.get(after)?;
    if *later <= time {
        return Some((to, to, 0.0));
    }
    let (earlier, from) = rows.get(after.checked_sub(1)?)?;
    let gap = later - earlier;
    (gap <= gap_s).then(|| (from, to, (time - earlier) / gap))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_before_and_after_are_found() {
        let rows = [(0.0, 'a'), (2.0, 'b'), (9.0, 'c')];
        assert_eq!(surrounding(&rows, 0.5, 2.0), Some((&'a', &'b', 0.25)));
        assert_eq!(surrounding(&rows, 2.0, 2.0), Some((&'b', &'b', 0.0)));
        for time in [-0.1, 5.0, 9.1, f64::NAN] {
            assert_eq!(surrounding(&rows, time, 2.0), None, "{time}");
        }
    }
}
