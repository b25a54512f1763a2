//! Extractors whose bearings are corrected by what recordings or the site show.

use core::{fmt, str::FromStr};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingMode, BearingModes, NoBearing, NoReading, Reading, Sample,
    Sweep, angle,
    parameter::{ParameterError, finite, in_range, not_negative, positive},
};

use super::BearingOffset;

/// σ of a direction that may be any: the root of the mean square of a uniform angle.
pub(super) const ANY_DIRECTION: f64 = 1.813_799_364_234_217_8;

/// Number of boresights that is as good as any larger number.
const LOOKS: usize = 8;

/// Boresights nearer than this, in radians, are one look: 22.5°.
const APART: f64 = core::f64::consts::FRAC_PI_8;

/// An extractor whose bearings are calibrated: a known offset is taken off, and σ is made what
/// recordings with truth showed it to be, σ² → (scale · σ)² + floor².
///
/// Competing directions are corrected alike. The correlation of level and bearing stays. A σ that
/// grows beyond that of a direction of which nothing is known (π/√3) is no bearing. Bearings may
/// be outliers with some probability: then any direction competes with the directions that were
/// found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated<X> {
    extractor: X,
    offset: BearingOffset,
    scale: f64,
    floor: f64,
    outlier_probability: f64,
}

impl<X> Calibrated<X> {
    /// The extractor as it is: no offset, its own σ.
    #[must_use]
    pub fn new(extractor: X) -> Self {
        let offset = BearingOffset::default();
        Self { extractor, offset, scale: 1.0, floor: 0.0, outlier_probability: 0.0 }
    }

    /// Sets the bearings' offset, measured minus true.
    ///
    /// # Errors
    ///
    /// If a number of it is not finite.
    pub fn with_offset(self, offset: BearingOffset) -> Result<Self, ParameterError> {
        finite("constant", offset.constant)?;
        finite("sin_heading", offset.sin_heading)?;
        finite("cos_heading", offset.cos_heading)?;
        Ok(Self { offset, ..self })
    }

    /// Sets σ² → (`scale` · σ)² + `floor`², the floor in radians.
    ///
    /// # Errors
    ///
    /// If the scale or the floor is negative or not finite, or both are 0.
    pub fn with_sigma(self, scale: f64, floor: f64) -> Result<Self, ParameterError> {
        let scale = not_negative("scale", scale)?;
        let floor = not_negative("floor", floor)?;
        positive("scale + floor", scale + floor)?;
        Ok(Self { scale, floor, ..self })
    }

    /// Sets the share of bearings that have nothing to do with the direction, as reflections and
    /// turns right above a transmitter give them. The reading's bearing stays what it was; an
    /// observation made of it takes the moments of all directions, so that estimators that do not
    /// weigh them one by one are careful: 2 % make 16° of a σ of 6°.
    ///
    /// # Errors
    ///
    /// If it is not from 0 to 0.5.
    pub fn with_outliers(self, probability: f64) -> Result<Self, ParameterError> {
        let outlier_probability =
            in_range("outlier_probability", probability, 0.0..=0.5, "from 0 to 0.5")?;
        Ok(Self { outlier_probability, ..self })
    }

    fn sigma(&self, sigma: f64) -> f64 {
        libm::hypot(self.scale * sigma, self.floor)
    }

    /// A direction with its error at the heading towards it taken off.
    fn angle(&self, sweep: &Sweep<'_>, direction: f64) -> f64 {
        if self.offset == BearingOffset::default() {
            return angle::wrap(direction);
        }
        angle::wrap(direction - self.offset.at(heading_towards(sweep, direction)))
    }

    /// The directions that compete, the only one where nothing else does.
    fn modes(&self, sweep: &Sweep<'_>, reading: &Reading) -> BearingModes {
        let alone = reading.bearing.as_ref().ok().map(|bearing| {
            [BearingMode { weight: 1.0, angle: bearing.angle, sigma: bearing.sigma }]
        });
        let own = match (reading.modes.as_slice(), &alone) {
            ([], Some(alone)) => alone,
            (modes, _) => modes,
        };
        let mut corrected = [BearingMode::default(); BearingModes::CAPACITY];
        let mut count = 0;
        for (new, mode) in corrected.iter_mut().zip(own) {
            let angle = self.angle(sweep, mode.angle);
            *new = BearingMode { angle, sigma: self.sigma(mode.sigma), ..*mode };
            count += 1;
        }
        if self.outlier_probability > 0.0 && count > 0 {
            // The most likely are first; where there is no room, any direction takes the last's.
            count = count.min(BearingModes::CAPACITY - 1);
            let found: f64 = corrected[..count].iter().map(|mode| mode.weight).sum();
            let weight = found * self.outlier_probability / (1.0 - self.outlier_probability);
            corrected[count] = BearingMode { weight, sigma: ANY_DIRECTION, ..corrected[0] };
            count += 1;
        }
        BearingModes::new(&corrected[..count]).unwrap_or_default()
    }
}

impl<X: BearingExtractor> BearingExtractor for Calibrated<X> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let reading = self.extractor.extract(sweep)?;
        // Directions that compete may be too far apart for a bearing.
        let modes = self.modes(sweep, &reading);
        let Ok(bearing) = reading.bearing else { return Ok(Reading { modes, ..reading }) };
        let angle = self.angle(sweep, bearing.angle);
        let sigma = self.sigma(bearing.sigma);
        if sigma > bearing.sigma.max(ANY_DIRECTION) {
            let too_wide = Err(NoBearing::TooWide { sigma, limit: ANY_DIRECTION });
            return Ok(Reading { bearing: too_wide, covariance: 0.0, modes, ..reading });
        }
        Ok(Reading {
            bearing: Ok(foxhunt_core::Bearing { angle, sigma, ..bearing }),
            covariance: reading.covariance * (sigma / bearing.sigma),
            modes,
            ..reading
        })
    }
}

/// The surroundings of a receiver, whose reflections turn bearings: an error that no turn shows by
/// itself.
///
/// The values are for turns of eight boresights or more. Bearings taken by telemetrists err by
/// published means of |error|, of which σ is √(π/2) as much; for streets and rooms σ is the
/// azimuth spread of arrival, as if the direction that is found were drawn from where the power
/// comes from (line of sight or not, root of the mean square), so that they are upper bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Site {
    /// Pasture and grassland: 6°, of a mean of 4.9° at 900 m (Grovenburg et al. 2013, Wildlife
    /// Biology 19(1), adult collars).
    Open,
    /// Woods and hills: 16°, of a mean of 12.6° (Hystrix 23(2), 12–18, 2012, roe deer in
    /// central Italy).
    Forest,
    /// Streets: 54°, of 49° with a line of sight and 59° without (3GPP TR 38.901, table 7.5-6,
    /// UMi street canyon, ASA at 2 GHz, which it has for all below).
    Street,
    /// Rooms: 51°, of 42° and 59° (the same table, indoor office, ASA at 6 GHz, which it has for
    /// all below).
    Indoors,
    /// Any of these, alike: 38°, the root of the mean of their squares.
    #[default]
    Unknown,
}

impl Site {
    /// Every site.
    pub const ALL: [Self; 5] =
        [Self::Open, Self::Forest, Self::Street, Self::Indoors, Self::Unknown];

    /// The site's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Forest => "forest",
            Self::Street => "street",
            Self::Indoors => "indoors",
            Self::Unknown => "unknown",
        }
    }

    /// σ of the site's effect on the bearing of a whole turn, in radians.
    #[must_use]
    pub fn sigma(self) -> f64 {
        let deg: f64 = match self {
            Self::Open => 6.0,
            Self::Forest => 16.0,
            Self::Street => 54.0,
            Self::Indoors => 51.0,
            Self::Unknown => 38.0,
        };
        deg.to_radians()
    }
}

impl fmt::Display for Site {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Site {
    type Err = &'static str;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let known = Self::ALL.into_iter().find(|site| site.name() == name);
        known.ok_or("it must be open, forest, street, indoors or unknown")
    }
}

/// An extractor whose σ holds the site's effect on bearings, σ² → σ² + site², for
/// recordings without a calibration.
///
/// A turn of fewer than eight boresights, those counted that are 22.5° apart or more, shows less
/// of what arrives from elsewhere, and σ of the site is √(8/n) times as much: a pattern of some
/// 90° of beamwidth has about three harmonics, and so about that many independent looks. Competing
/// directions are widened alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtSite<X> {
    extractor: X,
    site: Site,
}

impl<X> AtSite<X> {
    /// The extractor at a site.
    #[must_use]
    pub fn new(extractor: X, site: Site) -> Self {
        Self { extractor, site }
    }

    fn site_sigma(&self, sweep: &Sweep<'_>) -> f64 {
        let mut looks = [0.0; LOOKS];
        let mut count = 0;
        for sample in sweep.samples {
            let apart = |look: &f64| angle::distance(*look, sample.boresight) >= APART - 1e-9;
            if let (true, Some(next)) = (looks.iter().take(count).all(apart), looks.get_mut(count))
            {
                *next = sample.boresight;
                count += 1;
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "eight at most")]
        let share = LOOKS as f64 / count.max(1) as f64;
        self.site.sigma() * libm::sqrt(share)
    }
}

impl<X: BearingExtractor> BearingExtractor for AtSite<X> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let reading = self.extractor.extract(sweep)?;
        let site = self.site_sigma(sweep);
        let mut modes = [BearingMode::default(); BearingModes::CAPACITY];
        let own = reading.modes.as_slice();
        for (new, mode) in modes.iter_mut().zip(own) {
            *new = BearingMode { sigma: libm::hypot(mode.sigma, site), ..*mode };
        }
        let modes = BearingModes::new(&modes[..own.len()]).unwrap_or_default();
        let widened =
            |bearing: Bearing| Bearing { sigma: libm::hypot(bearing.sigma, site), ..bearing };
        Ok(Reading { bearing: reading.bearing.map(widened), modes, ..reading })
    }
}

/// Heading of the nose while the antenna looked to a direction: that of the nearest sample, so that
/// it holds for an antenna that is turned by a body, too.
#[must_use]
pub fn heading_towards(sweep: &Sweep<'_>, direction: f64) -> f64 {
    let off = |sample: &Sample| (angle::distance(sample.boresight, direction), sample.receiver);
    let nearest = sweep.samples.iter().map(off).min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or(sweep.receiver.heading, |(_, receiver)| receiver.heading)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{BeaconId, NoBearing, Pose, Sample};

    use super::*;

    /// Two directions, 3° and 4° wide, or none.
    struct Fixed(Result<Bearing, NoBearing>);

    impl BearingExtractor for Fixed {
        fn extract(&self, _: &Sweep<'_>) -> Result<Reading, NoReading> {
            let mode = |angle: f64, deg: f64| BearingMode { weight: 0.5, angle, sigma: rad(deg) };
            Ok(Reading {
                rss_dbm: -70.0,
                rss_sigma_db: 2.0,
                bearing: self.0,
                covariance: 0.01,
                modes: BearingModes::new(&[mode(0.2, 3.0), mode(2.0, 4.0)]).expect("two of them"),
            })
        }
    }

    fn rad(deg: f64) -> f64 {
        deg.to_radians()
    }

    /// A turn with readings along `boresights` boresights, `step_deg` apart.
    fn read(extractor: &dyn BearingExtractor, boresights: u16, step_deg: f64) -> Reading {
        let sample = |i: u16| Sample {
            time: f64::from(i),
            receiver: Pose::default(),
            boresight: rad(step_deg * f64::from(i)),
            position: i,
            rss_dbm: -70.0,
        };
        let samples: alloc::vec::Vec<Sample> = (0..boresights).map(sample).collect();
        let sweep = Sweep {
            beacon: BeaconId(0),
            time: 0.0,
            receiver: Pose::default(),
            positions: 128,
            samples: &samples,
            unanswered: &[],
            floor_dbm: None,
            receiver_sigma_m: None,
            measured: <_>::default(),
        };
        extractor.extract(&sweep).expect("a reading")
    }

    #[test]
    fn sigma_holds_the_site_the_more_the_fewer_boresights_there_are() {
        let bearing = Bearing { angle: 0.2, sigma: rad(5.0), confidence: 0.7 };
        for (boresights, step_deg, looks) in [
            (128, 2.8125, 8.0),
            (8, 45.0, 8.0),
            (16, 22.5, 8.0),
            (4, 90.0, 4.0),
            (3, 90.0, 3.0),
            // The same boresight again and again, and half a circle in steps of 11.25°.
            (100, 0.0, 1.0),
            (17, 11.25, 8.0),
            (9, 11.25, 5.0),
        ] {
            let plain = read(&Fixed(Ok(bearing)), boresights, step_deg);
            let at_site = AtSite::new(Fixed(Ok(bearing)), Site::Forest);
            let made = read(&at_site, boresights, step_deg);
            let site = rad(16.0) * libm::sqrt(8.0 / looks);
            let own = made.bearing.expect("one");
            assert!((own.sigma - libm::hypot(rad(5.0), site)).abs() < 1e-12, "{boresights}");
            for (mode, deg) in made.modes.as_slice().iter().zip([3.0, 4.0]) {
                assert!((mode.sigma - libm::hypot(rad(deg), site)).abs() < 1e-12, "{boresights}");
            }
            assert_eq!(made.modes.as_slice().len(), 2);
            // What a site does to bearings it does not do to levels.
            let back = Reading { bearing: plain.bearing, modes: plain.modes, ..made };
            assert_eq!(back, plain);
            assert_eq!(Bearing { sigma: rad(5.0), ..own }, bearing);
        }
        let none = NoBearing::TooWide { sigma: 2.0, limit: 1.0 };
        let made = read(&AtSite::new(Fixed(Err(none)), Site::Open), 8, 45.0);
        assert_eq!(made.bearing, Err(none));
    }

    #[test]
    fn sites_come_from_what_was_published() {
        // Means of |error| in degrees, and log₁₀ of azimuth spreads in degrees.
        let spread = |los: f64, nlos: f64| {
            let square = |log: f64| libm::pow(10.0, 2.0 * log);
            libm::sqrt(0.5 * (square(los) + square(nlos)))
        };
        let half_normal = libm::sqrt(core::f64::consts::FRAC_PI_2);
        let umi = libm::log10(1.0 + 2.0);
        let office = libm::log10(1.0 + 6.0);
        let derived = [
            (Site::Open, 4.9 * half_normal),
            (Site::Forest, 12.6 * half_normal),
            (Site::Street, spread(1.73 - 0.08 * umi, 1.81 - 0.08 * umi)),
            (Site::Indoors, spread(1.781 - 0.19 * office, 1.863 - 0.11 * office)),
        ];
        let mut square = 0.0;
        for (site, deg) in derived {
            assert_abs_diff_eq!(site.sigma().to_degrees(), deg, epsilon = 0.6);
            square += deg * deg / 4.0;
        }
        assert_abs_diff_eq!(Site::Unknown.sigma().to_degrees(), libm::sqrt(square), epsilon = 0.6);
        for site in Site::ALL {
            assert_eq!(site.name().parse(), Ok(site));
        }
        assert!("moon".parse::<Site>().is_err());
    }
}
