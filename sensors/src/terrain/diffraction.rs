//! Knife edges: ITU-R P.526-15, §4.1 and §4.5.1.

/// The Fresnel-Kirchhoff parameter ν = h √(2/λ · (1/d₁ + 1/d₂)) of an edge (ITU-R
/// P.526-15, §4.1): h is its height above the straight line between the antennas, negative below,
/// d₁ and d₂ are its distances from them, λ is the wavelength, all in metres and but for h
/// above 0.
#[must_use]
pub fn fresnel_parameter(height: f64, [d1, d2]: [f64; 2], wavelength: f64) -> f64 {
    height * libm::sqrt(2.0 / wavelength * (1.0 / d1 + 1.0 / d2))
}

/// The loss in dB behind a knife edge of the Fresnel-Kirchhoff parameter ν,
///
/// J(ν) = 6.9 + 20 log₁₀(√((ν − 0.1)² + 1) + ν − 0.1),
///
/// and none up to ν = −0.78 (ITU-R P.526-15, §4.1): 6 dB where the edge touches the line of
/// sight.
///
/// ```
/// use foxhunt_sensors::knife_edge_loss_db;
/// assert!((knife_edge_loss_db(0.0) - 6.03).abs() < 0.01);
/// assert!((knife_edge_loss_db(2.4) - 20.54).abs() < 0.01);
/// ```
#[must_use]
pub fn knife_edge_loss_db(parameter: f64) -> f64 {
    if parameter <= -0.78 {
        return 0.0;
    }
    let x = parameter - 0.1;
    // At −0.78 the formula is 3·10⁻³ dB.
    6.9 + 20.0 * libm::log10(libm::hypot(x, 1.0) + x)
}

/// The loss in dB of a whole path of `range` metres whose single equivalent edge has the parameter
/// ν: J + (1 − e^(−J/6)) (10 + 0.02 d), d in km (ITU-R P.526-15, §4.5.1).
pub(super) fn path_loss_db(parameter: f64, range: f64) -> f64 {
    let edge = knife_edge_loss_db(parameter);
    edge + (1.0 - libm::exp(-edge / 6.0)) * (10.0 + 0.02e-3 * range)
}

/// Bullington's equivalent knife edge of a profile: the tops of the ground as they are added, as
/// both antennas see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bullington {
    /// Heights of the antennas above the line that profile heights count from, in metres.
    antennas: [f64; 2],
    /// Between them, in metres.
    range: f64,
    /// The steepest slopes from either antenna to the ground.
    steepest: [f64; 2],
    /// The least square of the ground's depth below the line of sight over d₁ d₂.
    nearest: f64,
}

impl Bullington {
    pub(super) fn new(antennas: [f64; 2], range: f64) -> Self {
        let steepest = [f64::NEG_INFINITY; 2];
        Self { antennas, range, steepest, nearest: f64::INFINITY }
    }

    /// Adds ground `height` metres high, `along` metres from the first antenna and not at either.
    pub(super) fn add(&mut self, along: f64, height: f64) {
        let ([first, second], left) = (self.antennas, self.range - along);
        let sight = first + (second - first) * (along / self.range);
        let depth = sight - height;
        self.nearest = self.nearest.min(depth * depth / (along * left));
        let slopes = [(height - first) / along, (height - second) / left];
        for (steepest, slope) in self.steepest.iter_mut().zip(slopes) {
            *steepest = steepest.max(slope);
        }
    }

    /// The parameter ν of the equivalent edge, where the steepest lines of sight from both
    /// antennas meet; of the ground nearest to the line of sight where none is above it (ITU-R
    /// P.526-15, §4.5.1). Minus infinity without ground.
    pub(super) fn parameter(&self, wavelength: f64) -> f64 {
        let Self { antennas: [first, second], range, steepest: [ahead, back], nearest } = *self;
        let sight = (second - first) / range;
        if ahead <= sight {
            return -libm::sqrt(nearest * 2.0 * range / wavelength);
        }
        let at = (second - first + back * range) / (ahead + back);
        // What rounding leaves of an edge right at an antenna.
        let at = at.clamp(1e-9 * range, (1.0 - 1e-9) * range);
        fresnel_parameter((ahead - sight) * at, [at, range - at], wavelength)
    }
}

/// The parameter ν of level ground between two antennas so high above it: that of the place at
/// which it takes most, −2 √(2 h₁ h₂ / (λ d)).
pub(super) fn level_ground(antennas: [f64; 2], range: f64, wavelength: f64) -> f64 {
    -2.0 * libm::sqrt(2.0 * antennas[0] * antennas[1] / (wavelength * range))
}
