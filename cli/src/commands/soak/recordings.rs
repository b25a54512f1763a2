use std::{
    f64::consts::TAU,
    fmt::Write as _,
    panic::{AssertUnwindSafe, catch_unwind},
};

use foxhunt::{
    config::ExtractorConfig,
    core::Estimate,
    locate::LocateConfig,
    nalgebra::Vector2,
    recorded::{ReceptionConfig, receptions},
    recording::{ReadOptions, Recording},
    registry::Registry,
    soak::SoakFailure,
};

use super::runs::{Kind, Tally, least, text_of};

/// A recording of a few drones, which was bent, and cut off somewhere.
#[derive(Debug)]
pub struct BentRecording {
    seed: u64,
    text: Vec<u8>,
}

/// Numbers from a seed: SplitMix64 (Steele, Lea & Flood 2014), as the program has no generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Draws a number uniformly from [0, 1).
    fn share(&mut self) -> f64 {
        f64::from(u32::try_from(self.next() >> 32).unwrap_or(0)) / 2.0_f64.powi(32)
    }

    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.share()
    }

    /// Draws an index below `end`, or 0.
    fn below(&mut self, end: usize) -> usize {
        let end = u64::try_from(end).unwrap_or(u64::MAX).max(1);
        usize::try_from(self.next() % end).unwrap_or(0)
    }
}

/// A recording that could not be read.
const UNREAD: Kind = Kind::Recording { is_read: false };

/// Texts in bent rows in place of a number.
const INSTEAD: [&str; 12] = [
    "",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-0",
    "99999999999999999999",
    "x",
    "\"",
];

impl BentRecording {
    /// The recording of a seed.
    pub fn draw(seed: u64) -> Self {
        let mut random = Random(seed);
        let mut text = clean(&mut random).into_bytes();
        for _ in 0..random.below(4) {
            bend(&mut text, &mut random);
        }
        if random.share() < 0.2 {
            text.truncate(random.below(text.len() + 1));
        }
        Self { seed, text }
    }

    /// Takes a recording that an earlier soak has left, located as the seed chose.
    pub fn again(text: Vec<u8>, seed: u64) -> Self {
        Self { seed, text }
    }

    pub fn into_text(self) -> Vec<u8> {
        self.text
    }

    /// Cuts the recording down to as few lines as still make it fail.
    pub fn minimal(self, fails: impl Fn(&Self) -> bool) -> Self {
        let Self { seed, text } = self;
        let lines = text.split_inclusive(|byte| *byte == b'\n').collect();
        let lines = least(lines, |lines| fails(&Self { seed, text: lines.concat() }));
        Self { seed, text: lines.concat() }
    }

    /// Reads it, and locates each of its beacons with one estimator: places have to be finite, and
    /// nothing may panic.
    pub fn locate(&self, registry: &Registry) -> Tally {
        let located = catch_unwind(AssertUnwindSafe(|| self.locate_unguarded(registry)));
        located.unwrap_or_else(|panic| {
            let failures = vec![SoakFailure::new("panic", text_of(&*panic))];
            Tally { kind: UNREAD, failures, ..Tally::default() }
        })
    }

    fn locate_unguarded(&self, registry: &Registry) -> Tally {
        let read = Recording::from_reader(&self.text[..], "soak.csv", &ReadOptions::default());
        let Ok(recording) = read else {
            return Tally { kind: UNREAD, ..Tally::default() };
        };
        let mut random = Random(self.seed ^ u64::MAX);
        let kind = Kind::Recording { is_read: true };
        let mut tally = Tally { kind, ..Tally::default() };
        let extractors = registry.extractors();
        let estimators = registry.estimators();
        let (Some(extractor), Some(estimator)) = (
            extractors.get(random.below(extractors.len())).map(|entry| entry.config()),
            estimators.get(random.below(estimators.len())),
        ) else {
            return tally;
        };
        let extractor: ExtractorConfig = extractor;
        let Ok(extractor) = registry.build_extractor(&extractor) else { return tally };
        let recordings = [recording];
        for beacon in recordings[0].beacons() {
            let config = ReceptionConfig::default();
            let Ok(received) = receptions(&recordings, beacon, extractor.as_ref(), &config) else {
                continue;
            };
            let Ok(located) = estimator.locate(&received, &LocateConfig::default()) else {
                continue;
            };
            tally.located += 1;
            let Estimate { mean, covariance } = located.estimate;
            if !mean.iter().chain(covariance.iter()).all(|number| number.is_finite()) {
                let what = format!("{}: {mean:?}, {covariance:?}", estimator.name);
                tally.failures.push(SoakFailure::new("place", what));
            }
        }
        tally
    }
}

/// Receptions of a few drones from a beacon or two, without any error: turns of an antenna, or
/// levels and bearings that were made already.
fn clean(random: &mut Random) -> String {
    let beacons: Vec<Vector2<f64>> = (0..=random.below(2))
        .map(|_| Vector2::new(random.between(-200.0, 200.0), random.between(-200.0, 200.0)))
        .collect();
    let turns = random.share() < 0.5;
    let column = if turns { "boresight_deg_compass" } else { "bearing_deg_compass" };
    let mut text = format!("drone,beacon,turn,time_s,east_m,north_m,{column},rss_dbm\n");
    for place in 0..4 + random.below(12) {
        let at = Vector2::new(random.between(-200.0, 200.0), random.between(-200.0, 200.0));
        for (index, beacon) in beacons.iter().enumerate() {
            let way = beacon - at;
            let bearing = way.x.atan2(way.y).rem_euclid(TAU);
            let level = -30.0 - 25.0 * way.norm().max(1.0).log10();
            let looks = if turns { 16 } else { 1 };
            for (look, direction) in (0..looks).zip(0_u8..) {
                let turned = TAU * f64::from(direction) / 16.0;
                let (angle, rss) = match turns {
                    true => (turned, level + 12.0 * (turned - bearing).cos()),
                    false => (bearing, level),
                };
                // Writing to a string does not fail.
                let _ = writeln!(
                    text,
                    "uav{},fox {index},{place},{}.{look:02},{:.2},{:.2},{:.3},{rss:.2}",
                    place % 3,
                    10 * place,
                    at.x,
                    at.y,
                    angle.to_degrees(),
                );
            }
        }
    }
    text
}

/// Damages a text once, as a broken card or a careless hand might.
fn bend(text: &mut Vec<u8>, random: &mut Random) {
    let mut lines: Vec<Vec<u8>> = text.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let one = random.below(lines.len());
    let other = random.below(lines.len());
    match random.below(6) {
        0 => lines.swap(one, other),
        1 => drop(lines.remove(one)),
        2 => {
            let copy = lines[one].clone();
            lines.insert(other, copy);
        }
        3 => {
            let place = random.below(lines[one].len());
            let byte = u8::try_from(random.below(256)).unwrap_or(0);
            if let Some(old) = lines[one].get_mut(place) {
                *old = byte;
            }
        }
        4 => {
            let place = random.below(lines[one].len() + 1);
            lines[one].truncate(place);
        }
        _ => {
            let mut cells: Vec<&[u8]> = lines[one].split(|byte| *byte == b',').collect();
            let place = random.below(cells.len());
            cells[place] = INSTEAD[random.below(INSTEAD.len())].as_bytes();
            lines[one] = cells.join(&b',');
        }
    }
    *text = lines.join(&b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_are_read_located_and_refused() {
        let registry = Registry::builtin();
        let mut read = 0;
        let mut located = 0;
        let mut bent = 0;
        for seed in 0..60 {
            let recording = BentRecording::draw(seed);
            let tally = recording.locate(&registry);
            let failures: Vec<String> = tally.failures.iter().map(ToString::to_string).collect();
            assert!(failures.is_empty(), "seed {seed}: {failures:?}");
            read += u32::from(tally.kind == Kind::Recording { is_read: true });
            located += tally.located;
            let original = clean(&mut Random(seed)).into_bytes();
            bent += u32::from(recording.into_text() != original);
        }
        assert!((15..60).contains(&read), "{read} of 60 were read");
        assert!(located >= 10, "{located} places");
        assert!(bent > 30, "{bent} of 60 were bent");
    }

    #[test]
    fn a_reproducer_keeps_the_lines_that_fail_and_no_others() {
        let lines = (0..23).map(|line| format!("line {line}\n"));
        let recording = BentRecording::again(lines.collect::<String>().into_bytes(), 7);
        let both = |recording: &BentRecording| {
            let text = String::from_utf8_lossy(&recording.text);
            text.contains("line 3\n") && text.contains("line 17\n")
        };
        let least = recording.minimal(both);
        assert_eq!((least.seed, &least.text[..]), (7, &b"line 3\nline 17\n"[..]));
    }
}
