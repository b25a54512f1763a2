use foxhunt_core::parameter::positive;

use super::BatchError;

/// The loss of an observation's whitened residual, by its squared norm q: half of ρ(q).
///
/// The robust ones are minimised by reweighting: each observation counts ρ′(q). With one component
/// present, √q is the residual in standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Loss {
    /// ρ = q: Gaussian noise, least squares.
    #[default]
    Gaussian,
    /// ρ = q up to k², then 2k√q − k² (Huber 1964): bounded influence, convex.
    Huber {
        /// Number of standard deviations from which on the cost grows linearly; 1.345 keeps 95 %
        /// efficiency for Gaussian noise.
        k: f64,
    },
    /// ρ = c² ln(1 + q/c²) (Holland & Welsch 1977): far outliers do not count.
    Cauchy {
        /// The scale in standard deviations; 2.385 keeps 95 % efficiency for Gaussian noise.
        c: f64,
    },
    /// ρ = (ν + m) ln(1 + q/ν), m the components present: the noise is Student's t with the
    /// observation's covariance for its scale matrix (Lange, Little & Taylor 1989).
    StudentT {
        /// ν: 4 is usual.
        degrees: f64,
    },
}

impl Loss {
    pub(super) fn check(self) -> Result<Self, BatchError> {
        match self {
            Self::Gaussian => {}
            Self::Huber { k } => {
                positive("k", k)?;
            }
            Self::Cauchy { c } => {
                positive("c", c)?;
            }
            Self::StudentT { degrees } => {
                positive("degrees", degrees)?;
            }
        }
        Ok(self)
    }

    /// ρ(q) and its derivative for `m` components.
    pub(super) fn of(&self, q: f64, m: f64) -> (f64, f64) {
        match *self {
            Self::Huber { k } if q > k * k => {
                let root = libm::sqrt(q);
                (2.0 * k * root - k * k, k / root)
            }
            Self::Gaussian | Self::Huber { .. } => (q, 1.0),
            Self::Cauchy { c } => (c * c * libm::log1p(q / (c * c)), 1.0 / (1.0 + q / (c * c))),
            Self::StudentT { degrees } => {
                ((degrees + m) * libm::log1p(q / degrees), (degrees + m) / (degrees + q))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_derivatives() {
        let losses = [
            Loss::Gaussian,
            Loss::Huber { k: 1.345 },
            Loss::Cauchy { c: 2.385 },
            Loss::StudentT { degrees: 4.0 },
        ];
        for loss in losses {
            for q in [0.1, 1.0, 1.8, 1.82, 9.0, 400.0] {
                let step = 1e-6 * q;
                let numeric = (loss.of(q + step, 2.0).0 - loss.of(q - step, 2.0).0) / (2.0 * step);
                assert!((loss.of(q, 2.0).1 - numeric).abs() < 1e-7, "{loss:?} at {q}");
            }
        }
        assert!(Loss::Huber { k: 0.0 }.check().is_err());
        assert!(Loss::Cauchy { c: f64::NAN }.check().is_err());
        assert!(Loss::StudentT { degrees: -1.0 }.check().is_err());
    }
}
