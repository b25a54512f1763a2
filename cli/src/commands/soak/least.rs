/// Leaves out lines as long as the rest still fails: first halves, then quarters, down to single
/// lines (Zeller & Hildebrandt 2002).
pub(super) fn least<'a>(
    mut lines: Vec<&'a [u8]>,
    fails: impl Fn(&[&'a [u8]]) -> bool,
) -> Vec<&'a [u8]> {
    let mut size = lines.len().div_ceil(2);
    while size > 0 {
        let mut start = 0;
        while start < lines.len() {
            let end = lines.len().min(start + size);
            let shorter = [&lines[..start], &lines[end..]].concat();
            if fails(&shorter) {
                lines = shorter;
            } else {
                start = end;
            }
        }
        size /= 2;
    }
    lines
}
