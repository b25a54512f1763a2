use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector};

/// One direction that was received in one turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    /// Direction of the transmitter, in radians counter-clockwise of the boresight.
    pub(super) azimuth: f64,
    /// Level in dB, about the mean of its turn.
    pub(super) level_db: f64,
    /// Index of the turn.
    pub(super) turn: usize,
}

/// A Fourier series without a constant, aₖ cos kα + bₖ sin kα.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// a₁, b₁, a₂, b₂, …
    coefficients: Vec<f64>,
    pub(super) harmonics: u16,
    /// Standard deviation of the residuals, in dB.
    pub(super) sigma_db: f64,
}

/// cos α, sin α, cos 2α, sin 2α, …
fn harmonics(azimuth: f64, count: u16) -> impl Iterator<Item = f64> {
    (1..=count).flat_map(move |k| {
        let angle = f64::from(k) * azimuth;
        [libm::cos(angle), libm::sin(angle)]
    })
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows and columns")]
fn real(count: usize) -> f64 {
    count as f64
}

impl Series {
    /// The least-squares series with the number of harmonics, at most `most`, that minimises the
    /// generalised cross-validation n RSS / (n − p)² (Golub, Heath & Wahba 1979); [`None`] where
    /// that number is zero. Each turn has a level of its own, which is one of the p parameters.
    pub(super) fn fit(directions: &[Direction], turns: usize, most: u16) -> Option<Self> {
        let columns = 2 * usize::from(most);
        let mut design = DMatrix::zeros(directions.len(), columns);
        for (i, direction) in directions.iter().enumerate() {
            for (j, value) in harmonics(direction.azimuth, most).enumerate() {
                design[(i, j)] = value;
            }
        }
        // Regressors about their turns' means stand for the turns' own levels (Frisch & Waugh
        // 1933).
        for mut column in design.column_iter_mut() {
            centre(directions, turns, |i| column[i])
                .into_iter()
                .enumerate()
                .for_each(|(i, centred)| column[i] = centred);
        }
        let levels = DVector::from_vec(centre(directions, turns, |i| directions[i].level_db));
        let total = levels.norm_squared();
        let qr = design.qr();
        // One factorisation serves every number of harmonics: RSS falls by the squares of Qᵀy.
        let mut rotated = levels;
        qr.q_tr_mul(&mut rotated);
        let count = real(directions.len());
        let validate = |explained: f64, parameters: usize| {
            let freedom = count - real(parameters + turns);
            count * (total - explained).max(0.0) / (freedom * freedom)
        };
        let mut best = (validate(0.0, 0), 0, 0.0);
        let mut explained = 0.0;
        for harmonics in 1..=most {
            let parameters = 2 * usize::from(harmonics);
            explained += rotated.rows(parameters - 2, 2).norm_squared();
            let score = validate(explained, parameters);
            if score < best.0 {
                best = (score, harmonics, explained);
            }
        }
        let (_, harmonics, explained) = best;
        let parameters = 2 * usize::from(harmonics);
        let upper = qr.r().view((0, 0), (parameters, parameters)).into_owned();
        let solved = upper.solve_upper_triangular(&rotated.rows(0, parameters).into_owned())?;
        let freedom = count - real(parameters + turns);
        let sigma_db = libm::sqrt((total - explained).max(0.0) / freedom);
        let coefficients = solved.iter().copied().collect();
        (harmonics > 0).then_some(Self { coefficients, harmonics, sigma_db })
    }

    pub(super) fn at(&self, azimuth: f64) -> f64 {
        harmonics(azimuth, self.harmonics).zip(&self.coefficients).map(|(h, c)| h * c).sum()
    }
}

/// A value of each direction about its mean over the direction's turn.
fn centre(directions: &[Direction], turns: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = alloc::vec![(0.0, 0.0); turns];
    for (i, direction) in directions.iter().enumerate() {
        let (sum, count) = &mut sums[direction.turn];
        *sum += value(i);
        *count += 1.0;
    }
    let about = |(i, direction): (usize, &Direction)| {
        let (sum, count) = sums[direction.turn];
        value(i) - sum / count
    };
    directions.iter().enumerate().map(about).collect()
}
