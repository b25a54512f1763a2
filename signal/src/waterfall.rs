use std::{fmt, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

/// Least length of a transform, in seconds: a pulse of a tag fills one.
const FRAME_S: f64 = 0.02;

/// Powers over frequency and time, for people to look at: the highest of each stretch of time and
/// frequency, so that a short narrow pulse shows on a wide slow picture.
///
/// ```
/// use foxhunt_signal::Waterfall;
///
/// let mut waterfall = Waterfall::new(250e3, 80, 0.25).ok_or("no waterfall")?;
/// let samples = vec![Default::default(); 150_000];
/// let rows = waterfall.push(0, &samples);
/// assert_eq!((rows.len(), rows[0].above_noise_db.len()), (2, 80));
/// # Ok::<(), &str>(())
/// ```
pub struct Waterfall {
    rate_hz: f64,
    /// Transforms that make a row.
    frames: u64,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    buffer: Vec<Complex32>,
    /// The index of the next sample.
    expected: Option<u64>,
    /// The highest powers of the row that is not complete, the lowest frequency first.
    columns: Vec<f32>,
    taken: u64,
}

/// A row of a waterfall.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct WaterfallRow {
    /// Time of its end, in seconds of the samples' clock.
    pub time_s: f64,
    /// The highest power in each column, the lowest frequency first, over the median of all
    /// columns, in dB.
    pub above_noise_db: Vec<f32>,
}

impl fmt::Debug for Waterfall {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Waterfall")
            .field("rate_hz", &self.rate_hz)
            .field("columns", &self.columns.len())
            .finish_non_exhaustive()
    }
}

impl Waterfall {
    /// A waterfall of this many columns over the whole band, with a row every `row_s` seconds.
    ///
    /// `None` if the rate or the time is not finite and above 0, or there are no columns or more
    /// than 10,000.
    #[must_use]
    pub fn new(rate_hz: f64, columns: usize, row_s: f64) -> Option<Self> {
        let good = |value: f64| value.is_finite() && value > 0.0;
        if !good(rate_hz) || rate_hz > 1e9 || !good(row_s) || !(1..=10_000).contains(&columns) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2e7")]
        let least = (rate_hz * FRAME_S).ceil() as usize;
        let size = least.max(columns).next_power_of_two();
        #[expect(clippy::cast_precision_loss, reason = "below 2^26")]
        let frame_s = size as f64 / rate_hz;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let frames = (row_s / frame_s).round().clamp(1.0, 1e9) as u64;
        let fft = FftPlanner::new().plan_fft_forward(size);
        Some(Self {
            rate_hz,
            frames,
            scratch: vec![Complex32::default(); fft.get_inplace_scratch_len()],
            fft,
            buffer: Vec::with_capacity(size),
            expected: None,
            columns: vec![0.0; columns],
            taken: 0,
        })
    }

    /// Takes the samples from index `first` on, and returns the rows that they complete. A gap
    /// begins a new row.
    pub fn push(&mut self, first: u64, samples: &[Complex32]) -> Vec<WaterfallRow> {
        if self.expected != Some(first) {
            self.buffer.clear();
        }
        let mut rows = Vec::new();
        let mut left = samples;
        let mut index = first;
        while !left.is_empty() {
            let size = self.fft.len();
            let (part, rest) = left.split_at(left.len().min(size - self.buffer.len()));
            self.buffer.extend_from_slice(part);
            (left, index) = (rest, index.saturating_add(part.len() as u64));
            if self.buffer.len() == size {
                self.frame();
                self.buffer.clear();
                self.taken += 1;
            }
            if self.taken == self.frames {
                rows.push(self.row(index));
            }
        }
        self.expected = Some(index);
        rows
    }

    fn frame(&mut self) {
        self.fft.process_with_scratch(&mut self.buffer, &mut self.scratch);
        let size = self.buffer.len();
        let columns = self.columns.len();
        for (bin, value) in self.buffer.iter().enumerate() {
            // The second half of the bins is below the middle of the band.
            let place = (bin + size / 2) % size;
            let column = &mut self.columns[place * columns / size];
            *column = column.max(value.norm_sqr());
        }
    }

    fn row(&mut self, end: u64) -> WaterfallRow {
        let mut sorted = self.columns.clone();
        let middle = sorted.len() / 2;
        let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
        let median = median.max(f32::MIN_POSITIVE);
        let db = |power: &f32| 10.0 * (power.max(f32::MIN_POSITIVE) / median).log10();
        let above_noise_db = self.columns.iter().map(db).collect();
        self.columns.fill(0.0);
        self.taken = 0;
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let time_s = end as f64 / self.rate_hz;
        WaterfallRow { time_s, above_noise_db }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    #[test]
    fn a_short_pulse_stands_out_in_its_column_and_row() {
        let mut waterfall = Waterfall::new(10_000.0, 50, 0.25).expect("it is in order");
        // 20 ms at +1,100 Hz, 0.6 s after the beginning, on a little of everything.
        let sample = |n: u16| {
            let time = f32::from(n) / 1e4;
            let noise = Complex32::from_polar(0.01, f32::from(n).powi(2));
            let on = (0.60..0.62).contains(&time);
            noise + Complex32::from_polar(if on { 0.2 } else { 0.0 }, TAU * 1100.0 * time)
        };
        let samples: Vec<_> = (0..10_240).map(sample).collect();
        let mut rows = waterfall.push(0, &samples[..777]);
        rows.extend(waterfall.push(777, &samples[777..]));
        let highest = |row: &WaterfallRow| {
            let columns = row.above_noise_db.iter().enumerate();
            columns.max_by(|a, b| a.1.total_cmp(b.1)).map(|(column, db)| (column, *db))
        };
        let tops: Vec<_> = rows.iter().filter_map(highest).collect();
        assert_eq!(tops.len(), 4);
        // Columns are 200 Hz wide from -5,000 Hz on.
        assert!(tops[2].0 == 30 && tops[2].1 > 20.0, "{tops:?}");
        assert!(tops.iter().enumerate().all(|(i, top)| i == 2 || top.1 < 20.0), "{tops:?}");
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        for (rate, columns, row) in [(0.0, 10, 0.1), (1e3, 0, 0.1), (1e3, 10, f64::NAN)] {
            assert!(Waterfall::new(rate, columns, row).is_none());
        }
    }
}
