use core::{hint, mem};

use rand::{Rng, RngExt};

use super::{BLOCK, CHUNK, Divided, Threads, take_first, white::Draws};
use crate::{
    count::number,
    vectorised::{Kernel, sum},
};

/// Scheme by which a particle filter draws the ancestors of its next generation. Each scheme draws
/// a particle of weight w n w times on average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Resampling {
    /// One draw, then equal strides (Kitagawa 1996): a particle comes ⌊n w⌋ or ⌈n w⌉ times, and
    /// little noise is added.
    #[default]
    Systematic,
    /// Independent draws (Gordon, Salmond & Smith 1993): what most theorems are about.
    Multinomial,
    /// One draw in each of n strides (Kitagawa 1996): less noise than independent draws, and
    /// without what equal strides may have in common with the weights.
    Stratified,
    /// ⌊n w⌋ copies of each, and independent draws for the remainder (Liu & Chen 1998).
    Residual,
}

impl Resampling {
    /// Fills `ancestors` with indices into `weights`, which sum to 1; weights of 0 are never drawn.
    /// There is room in `scratch` for as many numbers, twice, and for two for each block.
    pub(super) fn draw(
        self,
        weights: &[f64],
        rng: &mut impl Rng,
        scratch: [&mut [f64]; 3],
        ancestors: &mut [u32],
        threads: Threads,
    ) {
        match self {
            Self::Systematic => {
                let start = rng.random::<f64>();
                let strides = number(ancestors.len());
                let [_, _, reaches] = scratch;
                copies(weights, reaches, ancestors, threads, move |reach: f64| {
                    let before = (reach * strides - start).max(0.0);
                    let nearest = nearest(before);
                    nearest + usize::from(number(nearest) < before)
                });
            }
            Self::Multinomial => multinomial(weights, rng, scratch, ancestors, threads),
            Self::Stratified => stratified(weights, rng, ancestors),
            Self::Residual => residual(weights, rng, scratch, ancestors, threads),
        }
    }
}

fn multinomial(
    weights: &[f64],
    rng: &mut impl Rng,
    [marks, begins, sums]: [&mut [f64]; 3],
    ancestors: &mut [u32],
    threads: Threads,
) {
    let count = ancestors.len();
    let marks = &mut marks[..count];
    let begins = &mut begins[..count];
    let (before, reaches) = sums.split_at_mut(count.div_ceil(BLOCK));
    let total = ascending(rng.next_u64(), marks, before, threads);
    let bins = number(count) / total;
    threads.run(Bins { bins, marks, before, first: 0, begins, begin: 0 });
    let marks = &*marks;
    let begins = &*begins;
    copies(weights, reaches, ancestors, threads, move |reach: f64| {
        let reach = reach * total;
        let mut first = index_of(begins[nearest(reach * bins).min(count - 1)]);
        // A bin holds one mark on average and seldom more than four.
        while let Some(near) = marks.get(first..).and_then(<[f64]>::first_chunk::<4>) {
            // The sign of a difference: of positive numbers the bits are ordered alike.
            let below = |mark: &f64| mark.to_bits().wrapping_sub(reach.to_bits()) >> 63;
            let below: u64 = near.iter().map(below).sum();
            first += index_of(f64::from_bits(below));
            if below < 4 {
                return first;
            }
        }
        first + marks[first..].iter().take_while(|mark| **mark < reach).count()
    });
}

/// Makes each of `begins` how many marks lie in the bins before it, as the bits of a number. There
/// are as many bins as marks.
struct Bins<'a> {
    /// A mark's bin is nearest to its product with this.
    bins: f64,
    /// Within their block; here they are made the whole sums.
    marks: &'a mut [f64],
    /// The last mark before each block.
    before: &'a [f64],
    /// Number of marks before these.
    first: usize,
    begins: &'a mut [f64],
    /// The first of `begins` among all.
    begin: usize,
}

impl Kernel for Bins<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { bins, begins, first, .. } = self;
        begins.fill(0.0);
        if let Some(begin) = begins.first_mut() {
            *begin = f64::from_bits(first as u64);
        }
        let mut marks_before = first as u64;
        let after = 1_usize.wrapping_sub(self.begin);
        for (marks, before) in self.marks.chunks_mut(BLOCK).zip(self.before) {
            for mark in marks {
                *mark += before;
                marks_before += 1;
                if let Some(begin) = begins.get_mut(nearest(*mark * bins).wrapping_add(after)) {
                    *begin = f64::from_bits(marks_before);
                }
            }
        }
        let mut before = 0;
        for begin in begins {
            before = larger(before, begin.to_bits());
            *begin = f64::from_bits(before);
        }
    }
}

impl Divided for Bins<'_> {
    fn particles(&self) -> usize {
        self.marks.len()
    }

    fn split_at(mut self, marks: usize) -> (Self, Self) {
        let (before, later) = self.before.split_at(marks / BLOCK);
        // The bin after that of the last mark is the first that all of these lie before.
        let begin = nearest(later[0] * self.bins) + 1;
        let end = (begin - self.begin).min(self.begins.len());
        let begins = take_first(&mut self.begins, end);
        let begin = self.begin + end;
        let first = self.first + marks;
        let marks = take_first(&mut self.marks, marks);
        (Self { marks, before, begins, ..self }, Self { before: later, first, begin, ..self })
    }

    fn join((): (), (): ()) {}
}

/// Makes each of `ancestors` the particle whose copy it is, if the copies of one begin where
/// `begin` makes of the sum of the weights before it. `reaches` holds these sums for each block.
fn copies(
    weights: &[f64],
    reaches: &mut [f64],
    ancestors: &mut [u32],
    threads: Threads,
    begin: impl Fn(f64) -> usize + Copy + Send,
) {
    let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(0);
    let weights = &weights[..=last];
    let reaches = &mut reaches[..weights.len().div_ceil(BLOCK)];
    threads.run(Sums { weights, sums: &mut *reaches });
    let _ = add_up(reaches);
    threads.run(Copies { weights, first: 0, reaches, ancestors, offset: 0, begin });
}

/// The sum of each block of weights.
struct Sums<'a> {
    weights: &'a [f64],
    sums: &'a mut [f64],
}

impl Kernel for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (weights, total) in self.weights.chunks(BLOCK).zip(self.sums) {
            *total = sum(weights);
        }
    }
}

impl Divided for Sums<'_> {
    fn particles(&self) -> usize {
        self.weights.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let (before, weights) = self.weights.split_at(particles);
        let sums = take_first(&mut self.sums, particles / BLOCK);
        (Self { weights: before, sums }, Self { weights, ..self })
    }

    fn join((): (), (): ()) {}
}

/// Makes each number the sum of those before it; returns that of all.
fn add_up(sums: &mut [f64]) -> f64 {
    sums.iter_mut().fold(0.0, |before, sum| before + mem::replace(sum, before))
}

/// Writes each particle where its copies begin, over one that has none; the largest so far is then
/// the ancestor. There is no branch to be predicted.
struct Copies<'a, B> {
    weights: &'a [f64],
    /// The first particle of these.
    first: usize,
    /// The sum of all weights before each block.
    reaches: &'a [f64],
    ancestors: &'a mut [u32],
    /// The first of `ancestors` among all.
    offset: usize,
    begin: B,
}

impl<B: Fn(f64) -> usize + Copy> Kernel for Copies<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { ancestors, offset, begin, .. } = self;
        ancestors.fill(0);
        let mut particle = self.first;
        for (weights, before) in self.weights.chunks(BLOCK).zip(self.reaches) {
            let mut sum = 0.0;
            for weight in weights {
                let begin = begin(before + sum).wrapping_sub(offset);
                // At the end of a block the sum may round to less than the next one begins with.
                let begin = hint::select_unpredictable(*weight > 0.0, begin, usize::MAX);
                if let Some(ancestor) = ancestors.get_mut(begin) {
                    *ancestor = index(particle);
                }
                sum += weight;
                particle += 1;
            }
        }
        let mut largest = 0;
        for ancestor in ancestors {
            largest = larger(largest, *ancestor);
            *ancestor = largest;
        }
    }
}

impl<B: Fn(f64) -> usize + Copy> Divided for Copies<'_, B> {
    fn particles(&self) -> usize {
        self.weights.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let (before, weights) = self.weights.split_at(particles);
        let (reaches, later) = self.reaches.split_at(particles / BLOCK);
        let end = ((self.begin)(later[0]) - self.offset).min(self.ancestors.len());
        let ancestors = take_first(&mut self.ancestors, end);
        let first = self.first + particles;
        let offset = self.offset + end;
        (
            Self { weights: before, reaches, ancestors, ..self },
            Self { weights, first, reaches: later, offset, ..self },
        )
    }

    fn join((): (), (): ()) {}
}

/// The larger one, by no branch: nothing could predict it.
#[inline(always)]
fn larger<T: Copy + PartialOrd>(a: T, b: T) -> T {
    hint::select_unpredictable(b > a, b, a)
}

fn stratified(weights: &[f64], rng: &mut impl Rng, ancestors: &mut [u32]) {
    let count = number(ancestors.len());
    let mut walk = Walk::over(weights, |weight| weight);
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        *ancestor = walk.to((number(i) + rng.random::<f64>()) / count);
    }
}

/// Independent uniform numbers in ascending order, but for a factor that it returns; within each
/// block, what is `before` it is not added yet.
///
/// Without sorting: the sums of k of n + 1 exponential numbers over that of all of them are
/// distributed so (Devroye 1986, §V.2.2).
fn ascending(key: u64, marks: &mut [f64], before: &mut [f64], threads: Threads) -> f64 {
    let chunks = marks.len().div_ceil(CHUNK);
    let before = &mut before[..marks.len().div_ceil(BLOCK)];
    threads.run(Exponentials { key, first: 0, marks, sums: &mut *before });
    let mut last = [0.0];
    Draws::new(key).fill_exponential(chunks, &mut last);
    add_up(before) + last[0]
}

/// The sums of exponential numbers within each block.
struct Exponentials<'a> {
    key: u64,
    /// Number of marks before these.
    first: usize,
    marks: &'a mut [f64],
    /// Sum of each whole block.
    sums: &'a mut [f64],
}

impl Kernel for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut draws = Draws::new(self.key);
        let mut chunk = self.first / CHUNK;
        for (marks, total) in self.marks.chunks_mut(BLOCK).zip(self.sums) {
            let mut sum = 0.0;
            for marks in marks.chunks_mut(CHUNK) {
                draws.fill_exponential(chunk, marks);
                chunk += 1;
                for mark in marks {
                    sum += *mark;
                    *mark = sum;
                }
            }
            *total = sum;
        }
    }
}

impl Divided for Exponentials<'_> {
    fn particles(&self) -> usize {
        self.marks.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let marks = take_first(&mut self.marks, particles);
        let sums = take_first(&mut self.sums, particles / BLOCK);
        let first = self.first + particles;
        (Self { marks, sums, ..self }, Self { first, ..self })
    }

    fn join((): (), (): ()) {}
}

fn residual(
    weights: &[f64],
    rng: &mut impl Rng,
    [marks, _, before]: [&mut [f64]; 3],
    ancestors: &mut [u32],
    threads: Threads,
) {
    let all = number(ancestors.len());
    // A share that rounding left just below a whole copy is one.
    let copies = |weight: f64| libm::floor(weight * all * (1.0 + 4.0 * f64::EPSILON));
    let rest = |weight: f64| (weight * all - copies(weight)).max(0.0);
    let mut whole = 0;
    let mut broken = 0.0;
    for weight in weights {
        whole += floor(copies(*weight));
        broken += rest(*weight);
    }
    let whole = whole.min(ancestors.len());

    // The draws, in order, go to the end of `ancestors`, and are merged from there.
    let marks = &mut marks[whole..ancestors.len()];
    let total = ascending(rng.next_u64(), marks, before, threads);
    for (marks, before) in marks.chunks_mut(BLOCK).zip(before) {
        marks.iter_mut().for_each(|mark| *mark += *before);
    }
    let mut walk = Walk::over(weights, |weight| rest(weight) / broken * total);
    for (ancestor, mark) in ancestors[whole..].iter_mut().zip(marks) {
        *ancestor = walk.to(*mark);
    }
    let mut write = 0;
    let mut read = whole;
    for (i, weight) in weights.iter().enumerate() {
        for _ in 0..floor(copies(*weight)) {
            if write < read {
                ancestors[write] = index(i);
                write += 1;
            }
        }
        while read < ancestors.len() && ancestors[read] == index(i) {
            ancestors[write] = index(i);
            write += 1;
            read += 1;
        }
    }
}

/// The whole part of a number that is no larger than a cloud; 0 of a negative one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a share of a count, rounded down"
)]
fn floor(share: f64) -> usize {
    share as usize
}

/// The whole number nearest to one that is not negative, and below 2³².
#[inline(always)]
fn nearest(share: f64) -> usize {
    // The sum has no room for a fraction: two instructions, where a cast is a dozen.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    index_of(f64::from_bits((share + WHOLE).to_bits() & 0xffff_ffff))
}

/// The index whose bits a number holds.
#[expect(clippy::cast_possible_truncation, reason = "what is stored is below 2³²")]
fn index_of(bits: f64) -> usize {
    bits.to_bits() as usize
}

/// The index of a particle: there are fewer than 2³².
#[expect(clippy::cast_possible_truncation, reason = "checked where a cloud is made")]
fn index(particle: usize) -> u32 {
    particle as u32
}

/// A walk up the cumulative sum of what `share` makes of weights.
struct Walk<'a, S> {
    weights: &'a [f64],
    share: S,
    at: usize,
    reach: f64,
    /// The last particle that can be drawn: the sum may round to less than 1.
    last: usize,
}

impl<'a, S: Fn(f64) -> f64> Walk<'a, S> {
    fn over(weights: &'a [f64], share: S) -> Self {
        let last = weights.iter().rposition(|w| share(*w) > 0.0).unwrap_or(0);
        let reach = weights.first().copied().map_or(0.0, &share);
        Self { weights, share, at: 0, reach, last }
    }

    /// The particle whose share holds `mark`; marks ascend.
    fn to(&mut self, mark: f64) -> u32 {
        while self.reach <= mark && self.at < self.last {
            self.at += 1;
            self.reach += (self.share)(self.weights[self.at]);
        }
        index(self.at)
    }
}

#[cfg(test)]
mod tests {
    use alloc::{vec, vec::Vec};
    use approx::assert_abs_diff_eq;

    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::{super::Weights, *};

    const WEIGHTS: [f64; 6] = [0.0, 0.05, 0.4, 0.3, 0.25, 0.0];

    fn draw(scheme: Resampling, weights: &[f64], rng: &mut impl Rng, ancestors: &mut [u32]) {
        let mut scratch = Weights::even(weights.len());
        scheme.draw(weights, rng, scratch.scratch(), ancestors, Threads::One);
    }

    /// Returns the mean count of each particle over 20 000 draws from seed 1; `each` sees the
    /// counts of one.
    fn mean_counts(scheme: Resampling, mut each: impl FnMut(&[u32; 6])) -> [f64; 6] {
        const DRAWS: u32 = 20_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut totals = [0.0; 6];
        for _ in 0..DRAWS {
            let mut ancestors = [u32::MAX; 6];
            draw(scheme, &WEIGHTS, &mut rng, &mut ancestors);
            assert!(ancestors.is_sorted());
            let mut counts = [0; 6];
            for ancestor in ancestors {
                counts[ancestor as usize] += 1;
            }
            each(&counts);
            for (total, count) in totals.iter_mut().zip(counts) {
                *total += f64::from(count) / f64::from(DRAWS);
            }
        }
        totals
    }

    #[test]
    fn systematic_is_even_and_unbiased() {
        let means = mean_counts(Resampling::Systematic, |counts| {
            for (weight, count) in WEIGHTS.iter().zip(counts) {
                assert!((f64::from(*count) - 6.0 * weight).abs() < 1.0, "{count} of {weight}");
            }
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // Beyond its floor a count is Bernoulli: σ ≤ 0.5 / √20 000; five of them, so a false
            // alarm comes once in 3 million runs.
            assert_abs_diff_eq!(mean, 6.0 * weight, epsilon = 5.0 * 0.5 / libm::sqrt(20_000.0));
        }
    }

    #[test]
    fn large_clouds_are_drawn_as_their_weights() {
        // Five blocks, one of them without any weight, as are the last particles; seed 5.
        const COUNT: usize = 4 * BLOCK + 1000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let empty = |i: usize| i / BLOCK == 1 || i % 7 == 3 || i > 4 * BLOCK + 500;
        let weight = |i| if empty(i) { 0.0 } else { rng.random::<f64>() };
        let mut weights: Vec<f64> = (0..COUNT).map(weight).collect();
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        for scheme in [Resampling::Systematic, Resampling::Multinomial, Resampling::Residual] {
            let mut ancestors = vec![u32::MAX; COUNT];
            let mut counts = vec![0.0; COUNT];
            draw(scheme, &weights, &mut rng, &mut ancestors);
            assert!(ancestors.is_sorted(), "{scheme:?}");
            ancestors.iter().for_each(|ancestor| counts[*ancestor as usize] += 1.0);
            for (i, (weight, count)) in weights.iter().zip(&counts).enumerate() {
                let expected = weight * number(COUNT);
                assert!(*weight > 0.0 || *count < 1.0, "{scheme:?}: {i} has no weight");
                if scheme == Resampling::Systematic {
                    assert!((count - expected).abs() < 1.0 + 1e-9, "{i}: {count} of {expected}");
                }
            }
            // Neighbours together: a variance of at most their expected number, five σ of it for
            // 170 counts of each scheme, a false alarm in 5000 seeds.
            for (weights, counts) in weights.chunks(100).zip(counts.chunks(100)) {
                let expected = weights.iter().sum::<f64>() * number(COUNT);
                let count: f64 = counts.iter().sum();
                let off = (count - expected).abs();
                assert!(off <= 5.0 * libm::sqrt(expected) + 1.0, "{scheme:?}: {count}, {expected}");
            }
        }
    }

    #[test]
    fn multinomial_counts_are_binomial() {
        let mut squares = [0.0; 6];
        let means = mean_counts(Resampling::Multinomial, |counts| {
            for (square, (weight, count)) in squares.iter_mut().zip(WEIGHTS.iter().zip(counts)) {
                let off = f64::from(*count) - 6.0 * weight;
                *square += off * off / 20_000.0;
            }
        });
        for ((weight, mean), square) in WEIGHTS.iter().zip(means).zip(squares) {
            let variance = 6.0 * weight * (1.0 - weight);
            let band = 5.0 * libm::sqrt(variance / 20_000.0);
            assert_abs_diff_eq!(mean, 6.0 * weight, epsilon = band);
            // The variance of a squared deviation is at most 3 of its square here, by the
            // binomial's kurtosis 3 + (1 − 6 w (1 − w)) / variance.
            let kurtosis = 3.0 + (1.0 - 6.0 * weight * (1.0 - weight)) / variance.max(1e-9);
            let band = 5.0 * variance * libm::sqrt((kurtosis - 1.0) / 20_000.0);
            assert_abs_diff_eq!(square, variance, epsilon = band);
        }
    }

    #[test]
    fn residual_gives_whole_shares_whole() {
        // Six times the weights: 0.3, 2.4, 1.8 and 1.5; the whole copies are certain, and 2 draws
        // are left for the rest.
        let means = mean_counts(Resampling::Residual, |counts| {
            assert!(counts[2] >= 2 && counts[3] >= 1 && counts[4] >= 1, "{counts:?}");
            assert!(counts[0] == 0 && counts[5] == 0, "{counts:?}");
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // Two draws of at most ½: a variance of ½; five σ of the mean of 20 000.
            assert_abs_diff_eq!(mean, 6.0 * weight, epsilon = 5.0 * libm::sqrt(0.5 / 20_000.0));
        }
        // Even weights are all copied once.
        let mut ancestors = [u32::MAX; 10];
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
        draw(Resampling::Residual, &[0.1; 10], &mut rng, &mut ancestors);
        assert_eq!(ancestors, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn stratified_is_unbiased_within_a_stride() {
        let means = mean_counts(Resampling::Stratified, |counts| {
            for (weight, count) in WEIGHTS.iter().zip(counts) {
                assert!((f64::from(*count) - 6.0 * weight).abs() < 2.0, "{count} of {weight}");
            }
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // A draw in each of two strides may or may not fall to a particle: a variance of ½.
            assert_abs_diff_eq!(mean, 6.0 * weight, epsilon = 5.0 * libm::sqrt(0.5 / 20_000.0));
        }
    }
}
