use super::dates::{clock_seconds, is_date, is_day};

/// Least number of decimals of a place in degrees: 100 m.
const DECIMALS: usize = 3;

/// Returns true if a line holds values instead of names: at least half of its cells are numbers or
/// times, and no fewer than two.
pub(super) fn is_row(cells: &[String]) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let is_value = |cell: &&String| number(cell).is_some() || is_time(cell) || is_day(cell);
    let values = cells.iter().filter(is_value).count();
    values >= 2 && 2 * values >= filled
}

/// Names that the cells of a row may have, as an example for who knows them: `-` for a cell that
/// may be anything.
pub(super) fn names(cells: &[String]) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = cells.iter().map(|_| "-").collect();
    let mut set = |index: usize, name: &'static str| {
        let is_new = !names.contains(&name);
        if let Some(place) = names.get_mut(index).filter(|place| **place == "-" && is_new) {
            *place = name;
        }
    };
    let within = |cell: &str, limit: f64| number(cell).is_some_and(|value| value.abs() <= limit);
    let is_place = |lat: &str, lon: &str| {
        decimals(lat) >= DECIMALS
            && decimals(lon) >= DECIMALS
            && within(lat, 90.0)
            && within(lon, 360.0)
    };
    let pair = |is: &dyn Fn(&str, &str) -> bool| {
        cells.windows(2).position(|pair| matches!(pair, [first, second] if is(first, second)))
    };
    if let Some(first) = pair(&is_place) {
        set(first, "lat");
        set(first + 1, "lon");
    }
    for (index, cell) in cells.iter().enumerate() {
        match number(cell) {
            _ if is_time(cell) => set(index, "time"),
            _ if is_day(cell) => set(index, "date"),
            Some(value) if value >= 1e8 => set(index, "time"),
            Some(value) if (-160.0..-9.0).contains(&value) => set(index, "rssi"),
            _ => {}
        }
    }
    let last = cells.len().saturating_sub(1);
    let is_angle = cells.last().and_then(|cell| number(cell));
    if is_angle.is_some_and(|value| (0.0..=360.0).contains(&value)) {
        set(last, "bearing");
    }
    // Without degrees the first two numbers may be metres.
    let in_metres = !names.contains(&"lat");
    let free = |[a, b]: [&&str; 2]| *a == "-" && *b == "-";
    let first = names.windows(2).position(|pair| matches!(pair, [a, b] if free([a, b])));
    if let Some(first) = first.filter(|_| in_metres) {
        for (index, name) in [(first, "x"), (first + 1, "y")] {
            if let Some(place) = names.get_mut(index) {
                *place = name;
            }
        }
    }
    names
}

fn number(cell: &str) -> Option<f64> {
    cell.replace(',', ".").parse().ok().filter(|value: &f64| value.is_finite())
}

fn decimals(cell: &str) -> usize {
    cell.split_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len())
}

fn is_time(cell: &str) -> bool {
    is_date(cell) || clock_seconds(cell).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(row: &str) -> Vec<String> {
        row.split(';').map(str::to_owned).collect()
    }

    #[test]
    fn rows_are_told_from_headers() {
        for row in [
            "50.1;14.2;45",
            "fox;50,1;14,2;45",
            "2026-06-21 14:03:00;50.1",
            "14:03;-71",
            "2026-06-21;14:03;fox",
        ] {
            assert!(is_row(&cells(row)), "{row}");
        }
        for header in ["lat;lon;bearing", "a;b;c;1;2", "2026", ""] {
            assert!(!is_row(&cells(header)), "{header}");
        }
    }

    #[test]
    fn names_are_an_example() {
        for (row, expected) in [
            ("50.0755;14.4378;45", "lat,lon,bearing"),
            ("2026-06-21 14:03:00;50,0755;14,4378;-71", "time,lat,lon,rssi"),
            ("0;100;315", "x,y,bearing"),
            ("2026-06-21;14:03:00;-71", "date,time,rssi"),
            ("1782050580;50.0755;14.4378;fox;-71;3", "time,lat,lon,-,rssi,bearing"),
        ] {
            assert_eq!(names(&cells(row)).join(","), expected, "{row}");
        }
    }
}
