use std::{
    collections::VecDeque,
    fmt::Write as _,
    io::{self, Write},
    path::Path,
    time::{Duration, Instant},
};

use console::Term;
use foxhunt::signal::{Complex32, Waterfall, WaterfallRow};

use super::{
    input::{Input, Losses},
    tracker::{Tracker, rows},
};
use crate::error::CliError;

/// Time between two rows of the waterfall, in seconds.
pub const ROW_S: f64 = 0.25;

/// Time between two pictures.
const EVERY: Duration = Duration::from_millis(200);

/// Colours of a terminal with 256 of them, from noise to a strong pulse.
const COLOURS: [u8; 16] = [16, 17, 18, 19, 20, 26, 32, 38, 44, 49, 83, 154, 226, 214, 208, 196];

/// Characters in place of [`COLOURS`] on a terminal without colours.
const SHADES: [char; 16] =
    [' ', ' ', ' ', '.', '.', ':', ':', '-', '=', '+', '*', 'o', '%', '#', '@', '@'];

/// Levels of the lowest and the highest colour above the median of a row, in dB.
const RANGE_DB: [f32; 2] = [-1.0, 20.0];

/// Lines that are neither waterfall nor tags: what is received, the frequencies, what has happened.
const OTHER_LINES: usize = 4;

/// Number of rows of the table of tags besides tags.
const TABLE_LINES: usize = 4;

/// A waterfall and a table of tags on a terminal, which is as it was when this is dropped.
#[derive(Debug)]
pub struct Screen {
    term: Term,
    title: String,
    /// Frequencies at the left and the right end, if the absolute centre is known.
    ends_hz: [f64; 2],
    is_calibrated: bool,
    colours: bool,
    waterfall: Waterfall,
    rows: VecDeque<WaterfallRow>,
    news: String,
    drawn: Option<Instant>,
}

impl Screen {
    pub fn open(title: &str, input: &dyn Input, waterfall: Waterfall) -> Result<Self, CliError> {
        let rate = input.rate_hz();
        let center = input.center_hz().unwrap_or(0.0);
        let term = Term::stdout();
        let mut screen = Self {
            colours: std::env::var_os("NO_COLOR").is_none(),
            title: format!("{title}  {:.4} MHz  {:.0} kS/s", center / 1e6, rate / 1e3),
            ends_hz: [center - rate / 2.0, center + rate / 2.0],
            is_calibrated: false,
            term,
            waterfall,
            rows: VecDeque::new(),
            news: String::new(),
            drawn: None,
        };
        // A page of its own, so that what was there comes back.
        screen.write("\x1b[?1049h\x1b[?25l")?;
        Ok(screen)
    }

    /// Sets whether levels are in dBm.
    pub fn calibrated(mut self, is_calibrated: bool) -> Self {
        self.is_calibrated = is_calibrated;
        self
    }

    pub fn take(&mut self, first: u64, samples: &[Complex32]) {
        self.rows.extend(self.waterfall.push(first, samples));
        let most = usize::from(self.term.size().0);
        self.rows.drain(..self.rows.len().saturating_sub(most));
    }

    /// Draws if it is time to.
    pub fn draw(
        &mut self,
        tracker: &Tracker,
        time_s: f64,
        news: Option<&str>,
        losses: Losses,
    ) -> Result<(), CliError> {
        if let Some(news) = news {
            news.clone_into(&mut self.news);
        }
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < EVERY) {
            return Ok(());
        }
        self.drawn = Some(Instant::now());
        let (height, width) = self.term.size();
        let picture = self.picture(tracker, time_s, losses, [height.into(), width.into()]);
        self.write(&picture)
    }

    fn picture(
        &self,
        tracker: &Tracker,
        time_s: f64,
        losses: Losses,
        [height, width]: [usize; 2],
    ) -> String {
        let Losses { gaps, samples, stalls } = losses;
        let tags = rows(tracker.rows(), time_s, self.is_calibrated);
        let tags: Vec<&str> = tags.lines().collect();
        let most = height.saturating_sub(OTHER_LINES);
        let table = tags.len().min((most / 2).max(TABLE_LINES + 2)).min(most);
        let fall = most - table;
        let mut lines = vec![format!(
            "{}  {time_s:.1} s  {samples} samples lost in {gaps} gaps, {stalls} stalls",
            self.title
        )];
        let shown = self.rows.iter().skip(self.rows.len().saturating_sub(fall));
        let drawn: Vec<String> = shown.map(|row| self.row(row)).collect();
        lines.extend(std::iter::repeat_n(String::new(), fall - drawn.len()));
        lines.extend(drawn);
        lines.push(self.axis());
        lines.extend(tags.iter().take(table).map(|line| (*line).to_owned()));
        lines.push(format!("{} pulses of no tag  {}", tracker.others(), self.news));
        let mut text = "\x1b[H".to_owned();
        for line in &lines {
            // What is longer than the terminal is wide would push the rest down.
            let line = console::truncate_str(line, width.saturating_sub(1), "");
            let _ = write!(text, "{line}\x1b[0m\x1b[K\r\n");
        }
        text + "\x1b[J"
    }

    fn row(&self, row: &WaterfallRow) -> String {
        let mut text = String::new();
        for db in &row.above_noise_db {
            let [low, high] = RANGE_DB;
            let share = ((db - low) / (high - low)).clamp(0.0, 1.0);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 15")]
            let step = (share * 15.0).round() as usize;
            match (self.colours, COLOURS.get(step), SHADES.get(step)) {
                (true, Some(colour), _) => {
                    let _ = write!(text, "\x1b[48;5;{colour}m ");
                }
                (_, _, shade) => text.push(shade.copied().unwrap_or(' ')),
            }
        }
        text
    }

    /// The frequencies below the waterfall: at its ends and in the middle.
    fn axis(&self) -> String {
        let width = self.rows.back().map_or(0, |row| row.above_noise_db.len());
        let [low, high] = self.ends_hz;
        let name = |hz: f64| {
            if low > 0.0 { format!("{:.4} MHz", hz / 1e6) } else { format!("{:.1} kHz", hz / 1e3) }
        };
        let left = format!("└{}", name(low));
        let right = format!("{}┘", name(high));
        let middle = name(f64::midpoint(low, high));
        let room = width.saturating_sub(left.chars().count() + right.chars().count());
        format!("{left}{middle:^room$}{right}")
    }

    fn write(&mut self, text: &str) -> Result<(), CliError> {
        let out = &mut self.term;
        out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| {
            match error.kind() {
                io::ErrorKind::BrokenPipe => CliError::Closed,
                _ => CliError::writing(Path::new("the terminal"), error),
            }
        })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A terminal that is gone needs nothing back.
        let _ = self.write("\x1b[0m\x1b[?25h\x1b[?1049l");
    }
}
