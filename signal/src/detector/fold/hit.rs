use rustfft::num_complex::{Complex32, Complex64};

use super::{
    super::{channeliser::float, front::samples, refine::View},
    map::{Map, limited},
};

/// The places of a train's pulses, in samples of a channel and cycles per sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    /// The beginning of the first pulse.
    pub(super) start: f64,
    pub(super) interval: f64,
    /// The frequency of the first pulse.
    pub(super) frequency: f64,
    /// The frequency's rise from a pulse to the next.
    pub(super) drift: f64,
}

impl Course {
    pub(super) fn place(&self, pulse: usize) -> f64 {
        self.start + float(pulse) * self.interval
    }

    pub(super) fn frequency(&self, pulse: usize) -> f64 {
        self.frequency + float(pulse) * self.drift
    }
}

/// The energy of one pulse of a train.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Energy {
    /// Energy over the noise's power density, without what is no pulse.
    pub(super) energy: f64,
    /// The noise's power in a sample.
    pub(super) noise: f64,
}

/// Samples of a channel in which trains are measured.
pub(super) struct Scene<'a> {
    pub(super) samples: &'a [Complex32],
    /// The first sample's index.
    pub(super) origin: u64,
    /// The index of the map's first frame.
    pub(super) first: u64,
    pub(super) map: &'a Map,
    /// The noise's power at an index and a frequency.
    pub(super) noise: &'a dyn Fn(f64, f64) -> f64,
    pub(super) ceiling: f64,
    pub(super) pulses: usize,
    /// The steepest drift from a pulse to the next.
    pub(super) steepest: f64,
}

impl Scene<'_> {
    fn view(&self) -> View<'_> {
        View { samples: self.samples, noise: 1.0 }
    }

    /// The energy at a place and a frequency; 0 where there are no samples.
    pub(super) fn energy(&self, place: f64, frequency: f64) -> Energy {
        let noise = (self.noise)(place, frequency);
        let begin = place - super::super::front::index(self.origin);
        if begin < 0.0 {
            return Energy { energy: 0.0, noise };
        }
        let power = self.view().energy(samples(begin), self.map.length, frequency);
        Energy { energy: power * self.share(place, frequency) / noise, noise }
    }

    fn share(&self, place: f64, frequency: f64) -> f64 {
        let frame = (place - super::super::front::index(self.first)) / float(self.map.hop);
        self.map.share(frame, frequency)
    }

    pub(super) fn energies(&self, course: &Course) -> Vec<Energy> {
        let energy = |n: usize| self.energy(course.place(n), course.frequency(n));
        (0..self.pulses).map(energy).collect()
    }

    /// The energy, limited by the ceiling.
    pub(super) fn limited(&self, energy: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
        let limited = limited(energy as f32, self.ceiling as f32);
        f64::from(limited)
    }

    pub(super) fn statistic(&self, energies: &[Energy]) -> f64 {
        energies.iter().map(|energy| self.limited(energy.energy)).sum()
    }

    fn value(&self, course: &Course) -> f64 {
        self.statistic(&self.energies(course))
    }

    /// The best course between the points of the grid.
    pub(super) fn refine(&self, course: Course) -> Course {
        let bin = 0.5 / float(self.map.length);
        let course = self.best(course, bin / 2.0, |course, by| Course {
            frequency: course.frequency + by,
            ..course
        });
        let course = self.best_times(course);
        let middle = (float(self.pulses) - 1.0) / 2.0;
        let steepest = self.steepest;
        let course = if steepest > 0.0 {
            // By half a bin at the ends, about the middle.
            let step = (bin / 2.0 / middle).min(steepest);
            self.best(course, step, |course, by| {
                let drift = (course.drift + by).clamp(-steepest, steepest);
                let frequency = course.frequency - (drift - course.drift) * middle;
                Course { frequency, drift, ..course }
            })
        } else {
            course
        };
        self.best(course, bin / 4.0, |course, by| Course {
            frequency: course.frequency + by,
            ..course
        })
    }

    /// Refines a course as long as that wins: a strong train is above the threshold at places far
    /// from its own.
    pub(super) fn climb(&self, course: Course) -> Course {
        let mut best = course;
        let mut of = self.value(&course);
        for _ in 0..6 {
            let next = self.refine(best);
            let value = self.value(&next);
            if value <= of + 1e-3 {
                break;
            }
            (best, of) = (next, value);
        }
        best
    }

    /// Steps uphill, then the vertex of the parabola through three points.
    fn best(&self, course: Course, step: f64, moved: impl Fn(Course, f64) -> Course) -> Course {
        let mut course = course;
        let at = |course: Course, by: f64| self.value(&moved(course, by));
        let mut middle = self.value(&course);
        let [mut low, mut high] = [at(course, -step), at(course, step)];
        for _ in 0..3 {
            if high > middle && high >= low {
                course = moved(course, step);
                (low, middle, high) = (middle, high, at(course, step));
            } else if low > middle {
                course = moved(course, -step);
                (low, middle, high) = (at(course, -step), low, middle);
            } else {
                break;
            }
        }
        let curvature = 2.0 * middle - low - high;
        if curvature <= 0.0 {
            return course;
        }
        let by = step * ((high - low) / (2.0 * curvature)).clamp(-0.5, 0.5);
        let vertex = moved(course, by);
        if self.value(&vertex) > middle { vertex } else { course }
    }

    /// The best start within a hop and the best interval within a step of the grid.
    fn best_times(&self, course: Course) -> Course {
        let Map { length, hop, .. } = *self.map;
        let middle = (float(self.pulses) - 1.0) / 2.0;
        // Starts are tried this far from those of the course.
        let reach = 2 * hop;
        let step = time_step(length);
        let tried: Vec<(Vec<Complex64>, f64)> = (0..self.pulses)
            .map(|pulse| {
                let place = course.place(pulse);
                let frequency = course.frequency(pulse);
                let begin = place.round() - super::super::front::index(self.origin) - float(reach);
                let from = samples(begin);
                let to = (from + 2 * reach + length).min(self.samples.len());
                if begin < 0.0 || to < from + 2 * reach + length {
                    return (Vec::new(), 0.0);
                }
                let noise = (self.noise)(place, frequency) * float(length);
                (self.view().sums(from, to, frequency), self.share(place, frequency) / noise)
            })
            .collect();
        let value = |later: f64, longer: f64| -> f64 {
            let each = tried.iter().enumerate().map(|(pulse, (sums, weight))| {
                let by = later + (float(pulse) - middle) * longer;
                let begin = samples((float(reach) + by).clamp(0.0, 2.0 * float(reach)));
                match (sums.get(begin), sums.get(begin + length)) {
                    (Some(a), Some(b)) => self.limited((b - a).norm_sqr() * weight),
                    _ => 0.0,
                }
            });
            each.sum()
        };
        let mut best = (0.0, 0.0);
        let mut of = value(0.0, 0.0);
        for quarter in -4..=4_i32 {
            // The outer pulses move by up to half a hop.
            let longer = f64::from(quarter) / 8.0 * float(hop) / middle;
            let mut later = -float(hop);
            while later <= float(hop) {
                let sum = value(later, longer);
                if sum > of {
                    (best, of) = ((later, longer), sum);
                }
                later += float(step);
            }
        }
        let (later, longer) = best;
        Course {
            start: course.start + later - middle * longer,
            interval: course.interval + longer,
            ..course
        }
    }
}

/// The distance between refined starts, in samples.
pub(super) fn time_step(length: usize) -> usize {
    (length / 32).max(1)
}
