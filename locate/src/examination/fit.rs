use foxhunt_core::angle;
use nalgebra::{Matrix2, Vector2, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Measurement of a direction, a distance or a difference of distances, with its σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Datum {
    /// Index of the reception.
    pub reception: usize,
    pub kind: Kind,
    pub receiver: Vector3<f64>,
    /// Radians counter-clockwise from East, or metres.
    pub value: f64,
    pub sigma: f64,
    /// σ of the receiver's own place on each axis, in metres.
    pub receiver_sigma_m: f64,
}

/// Quantity of a [`Datum`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Bearing,
    Range,
    /// The distance from the receiver less the distance from this place.
    Difference(Vector3<f64>),
}

impl Datum {
    /// Returns measured minus expected over σ for a transmitter at a place.
    pub(crate) fn residual(&self, place: &Vector2<f64>, up: f64) -> f64 {
        let way = place.push(up) - self.receiver;
        let apart = match self.kind {
            Kind::Bearing => angle::wrap(self.value - libm::atan2(way.y, way.x)),
            Kind::Range => self.value - way.norm(),
            Kind::Difference(reference) => {
                self.value - way.norm() + (place.push(up) - reference).norm()
            }
        };
        apart / self.sigma_at(&way)
    }

    /// Returns σ with the part of the receiver's own place, for a way to the transmitter.
    fn sigma_at(&self, way: &Vector3<f64>) -> f64 {
        let own = match self.kind {
            Kind::Bearing => {
                let turned = self.receiver_sigma_m / way.xy().norm().max(f64::MIN_POSITIVE);
                // No bearing is less certain than one from anywhere.
                turned.min(std::f64::consts::PI)
            }
            Kind::Range | Kind::Difference(_) => self.receiver_sigma_m,
        };
        libm::hypot(self.sigma, own)
    }

    /// Returns σ with the part of the receiver's own place, for a transmitter at a place.
    pub(crate) fn sigma_towards(&self, place: &Vector2<f64>, up: f64) -> f64 {
        self.sigma_at(&(place.push(up) - self.receiver))
    }

    /// Returns the gradient of the expected value over σ.
    pub(crate) fn slope(&self, place: &Vector2<f64>, up: f64) -> Vector2<f64> {
        let way = place.push(up) - self.receiver;
        let unit = |way: Vector3<f64>| way.xy() / way.norm().max(f64::MIN_POSITIVE);
        let slope = match self.kind {
            Kind::Bearing => {
                let square = way.xy().norm_squared().max(f64::MIN_POSITIVE);
                Vector2::new(-way.y, way.x) / square
            }
            Kind::Range => unit(way),
            Kind::Difference(reference) => unit(way) - unit(place.push(up) - reference),
        };
        slope / self.sigma_at(&way)
    }

    /// Returns the bearing that points the other way; anything else as it is.
    pub(crate) fn reversed(&self) -> Self {
        match self.kind {
            Kind::Bearing => {
                Self { value: angle::wrap(self.value + std::f64::consts::PI), ..*self }
            }
            Kind::Range | Kind::Difference(_) => *self,
        }
    }
}

/// Place where measurements meet best by weighted least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    pub place: Vector2<f64>,
    /// Sum of the squared residuals over σ.
    pub misfit: f64,
    /// Sum of the products of the slopes, in 1/m².
    pub information: Matrix2<f64>,
}

/// Starts of a descent are the meetings of pairs among this many measurements.
const PAIRED: usize = 12;

/// Number of the best starts from which a descent goes on.
const DESCENTS: usize = 4;

/// Largest number of steps of a descent.
const STEPS: usize = 60;

/// Places farther away than this many times the extent of the receivers count as infinitely far.
const FAR: f64 = 1e4;

/// Returns the place where measurements meet best; `None` without measurements.
pub(crate) fn meeting(data: &[Datum], up: f64) -> Option<Meeting> {
    meeting_from(data, up, &starts(data))
}

fn meeting_from(data: &[Datum], up: f64, starts: &[Vector2<f64>]) -> Option<Meeting> {
    let cost = |place: &Vector2<f64>| -> f64 {
        data.iter().map(|datum| datum.residual(place, up).powi(2)).sum()
    };
    let mut starts: Vec<(Vector2<f64>, f64)> =
        starts.iter().map(|place| (*place, cost(place))).collect();
    starts.retain(|(place, cost)| cost.is_finite() && place.iter().all(|c| c.is_finite()));
    starts.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (centre, extent) = extent(data)?;
    let ends = starts.iter().take(DESCENTS).map(|(start, misfit)| {
        let mut end = (*start, *misfit);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (information, gradient) = normal(data, &end.0, up);
            let damped = information
                + Matrix2::from_diagonal(&information.diagonal()) * damping
                + Matrix2::identity() * f64::MIN_POSITIVE;
            let Some(factor) = damped.cholesky() else { break };
            let step = factor.solve(&gradient);
            let next = end.0 + step;
            let misfit = cost(&next);
            let is_near = (next - centre).norm() <= FAR * extent;
            if misfit < end.1 && is_near {
                let gain = end.1 - misfit;
                end = (next, misfit);
                damping = (damping * 0.2).max(1e-12);
                if gain < 1e-10 * (1.0 + misfit) {
                    break;
                }
            } else {
                damping *= 8.0;
                if damping > 1e8 {
                    break;
                }
            }
        }
        end
    });
    let (place, misfit) = ends.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Meeting { place, misfit, information: normal(data, &place, up).0 })
}

/// Σ s sᵀ and Σ s r of slopes and residuals.
pub(crate) fn normal(
    data: &[Datum],
    place: &Vector2<f64>,
    up: f64,
) -> (Matrix2<f64>, Vector2<f64>) {
    let mut information = Matrix2::zeros();
    let mut gradient = Vector2::zeros();
    for datum in data {
        let slope = datum.slope(place, up);
        information += slope * slope.transpose();
        gradient += slope * datum.residual(place, up);
    }
    (information, gradient)
}

/// Returns the centre of the receivers, and the largest distance from it or the largest measured
/// one where that is larger; at least a metre.
fn extent(data: &[Datum]) -> Option<(Vector2<f64>, f64)> {
    let centre = centre(data)?;
    let reach = |datum: &Datum| {
        let measured = match datum.kind {
            Kind::Bearing => 0.0,
            Kind::Range => datum.value.abs(),
            Kind::Difference(reference) => (reference.xy() - centre).norm(),
        };
        (datum.receiver.xy() - centre).norm().max(measured)
    };
    Some((centre, data.iter().map(reach).fold(1.0, f64::max)))
}

/// Returns the mean place of the receivers.
pub(crate) fn centre(data: &[Datum]) -> Option<Vector2<f64>> {
    let count = u32::try_from(data.len()).ok().filter(|count| *count > 0)?;
    let sum: Vector2<f64> = data.iter().map(|datum| datum.receiver.xy()).sum();
    Some(sum / f64::from(count))
}

/// Starts of the descents: meetings of pairs of bearings, places along each bearing, and a lattice
/// about the receivers.
fn starts(data: &[Datum]) -> Vec<Vector2<f64>> {
    let Some((centre, extent)) = extent(data) else { return Vec::new() };
    let stride = data.len().div_ceil(PAIRED).max(1);
    let some: Vec<&Datum> = data.iter().step_by(stride).collect();
    let ray = |datum: &Datum| Vector2::new(libm::cos(datum.value), libm::sin(datum.value));
    let is_bearing = |datum: &&&Datum| datum.kind == Kind::Bearing;
    let mut starts = Vec::new();
    for (count, a) in some.iter().filter(is_bearing).enumerate() {
        for b in some.iter().filter(is_bearing).skip(count + 1) {
            let crossing = ray(a).perp(&ray(b));
            let along = (b.receiver.xy() - a.receiver.xy()).perp(&ray(b)) / crossing;
            if along.is_finite() {
                starts.push(a.receiver.xy() + ray(a) * along);
            }
        }
        for reach in [0.3, 1.0, 5.0, 0.3 * FAR] {
            starts.push(a.receiver.xy() + ray(a) * (reach * extent));
        }
    }
    for (east, north) in (-3..=3).flat_map(|east| (-3..=3).map(move |north| (east, north))) {
        let away = Vector2::new(f64::from(east), f64::from(north));
        // Off the receivers themselves, where the slopes are singular.
        starts.push(centre + (away + Vector2::new(0.13, 0.07)) * (0.5 * extent));
    }
    // The direction in which all bearings look on average, infinitely far away.
    let mean: Vector2<f64> = data.iter().filter(|d| d.kind == Kind::Bearing).map(ray).sum();
    if mean.norm() > 0.0 {
        starts.push(centre + mean.normalize() * (0.5 * FAR * extent));
    }
    starts
}

/// Returns true unless measurements meet at infinity alone.
fn is_near(meeting: &Meeting, data: &[Datum]) -> bool {
    extent(data)
        .is_some_and(|(centre, extent)| (meeting.place - centre).norm() < 0.01 * FAR * extent)
}

/// Returns the probability of a misfit as large as this one where all σ are true. The place takes
/// two degrees of freedom; two measurements that meet nowhere still have one.
pub(crate) fn misfit_p(misfit: f64, count: usize) -> f64 {
    let degrees = u32::try_from(count.saturating_sub(2).max(1)).unwrap_or(u32::MAX);
    ChiSquared::new(f64::from(degrees)).map_or(1.0, |law| law.sf(misfit.max(0.0)))
}

/// Knowledge of the σ of measurements: how many measurements it is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    pub freedom: f64,
}

impl Scale {
    /// Returns the mean square of residuals over σ for a misfit of `count` measurements, with its
    /// degrees of freedom.
    pub(crate) fn of(self, misfit: f64, count: usize) -> (f64, f64) {
        let spare = u32::try_from(count.saturating_sub(2)).unwrap_or(u32::MAX);
        let degrees = self.freedom + f64::from(spare);
        ((self.freedom + misfit) / degrees, degrees)
    }
}

/// Measurement that the others contradict.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outlier {
    /// Position among the measurements.
    pub position: usize,
    /// Residual over σ from where the others meet.
    pub residual: f64,
    /// Probability of a residual as large somewhere among all measurements.
    pub p: f64,
}

/// Outliers, and where the other measurements meet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outliers {
    pub outliers: Vec<Outlier>,
    pub meeting: Meeting,
    /// Measurements without the outliers.
    pub rest: Vec<Datum>,
}

/// Probability of an outlier among measurements that have none.
const OUTLIER_P: f64 = 3e-3;

/// Drop of the misfit over the mean square by which an outlier has to lie ahead of the next
/// measurement that could be the wrong one.
const AHEAD: f64 = 9.0;

/// Up to this many measurements each is left out in turn; of more only the most suspicious ones.
const EACH: usize = 24;

/// Returns the measurements that the others contradict, at most a quarter of all. The most
/// suspicious ones are left out one after the other; the largest set is taken in which each is
/// improbable by the others' own scatter (Rosner 1983).
pub(crate) fn outliers(data: &[Datum], up: f64, scale: Scale) -> Option<Outliers> {
    let mut rest: Vec<(usize, Datum)> = data.iter().copied().enumerate().collect();
    let mut left_out: Vec<usize> = Vec::new();
    let mut found = None;
    let mut now = meeting(data, up)?;
    for _ in 0..(data.len() / 4).min(MOST_OUTLIERS) {
        let Some((position, next, is_ahead)) = next_out(&rest, &now, up, scale) else { break };
        rest.retain(|(at, _)| *at != position);
        left_out.push(position);
        now = next;
        if !is_ahead {
            continue;
        }
        let kept: Vec<Datum> = rest.iter().map(|(_, datum)| *datum).collect();
        let of = |position: &usize| {
            let datum = data.get(*position)?;
            outlier(datum, *position, &now, (data.len(), kept.len()), up, scale)
        };
        let outliers: Option<Vec<Outlier>> = left_out.iter().map(of).collect();
        let is_alone = |outlier: &Outlier| !has_witness(data, outlier.position);
        let all_alone = |outliers: &Vec<Outlier>| outliers.iter().all(is_alone);
        if let Some(outliers) = outliers.filter(|all| is_near(&now, &kept) && all_alone(all)) {
            found = Some(Outliers { outliers, meeting: now, rest: kept });
        }
    }
    found
}

/// Receivers as near as this to each other, in metres, are at one place.
const SAME_PLACE_M: f64 = 5.0;

/// Returns true if a bearing agrees with another one from its place: what a compass or a site does
/// to all bearings of a place makes none of them an outlier.
fn has_witness(data: &[Datum], position: usize) -> bool {
    let Some(datum) = data.get(position).filter(|datum| datum.kind == Kind::Bearing) else {
        return false;
    };
    data.iter().enumerate().any(|(at, other)| {
        at != position
            && other.kind == Kind::Bearing
            && (other.receiver - datum.receiver).norm() <= SAME_PLACE_M
            && angle::distance(other.value, datum.value)
                < 4.0 * libm::hypot(other.sigma, datum.sigma)
    })
}

/// Largest number of outliers that are looked for.
const MOST_OUTLIERS: usize = 12;

/// Returns the measurement without which the others meet best, where they meet then, and whether
/// it lies clearly ahead of the next one.
fn next_out(
    rest: &[(usize, Datum)],
    now: &Meeting,
    up: f64,
    scale: Scale,
) -> Option<(usize, Meeting, bool)> {
    let mut suspects: Vec<(usize, f64)> = (rest.iter())
        .map(|(position, datum)| (*position, datum.residual(&now.place, up).abs()))
        .collect();
    let is_many = suspects.len() > EACH;
    if is_many {
        suspects.sort_by(|a, b| b.1.total_cmp(&a.1));
        suspects.truncate(4);
    }
    let mut best: Option<(usize, Meeting)> = None;
    let mut second = f64::INFINITY;
    for (position, _) in suspects {
        let others: Vec<Datum> =
            rest.iter().filter(|(at, _)| *at != position).map(|(_, datum)| *datum).collect();
        let without =
            if is_many { meeting_from(&others, up, &[now.place]) } else { meeting(&others, up) };
        let Some(without) = without else { continue };
        match &best {
            Some((_, first)) if first.misfit <= without.misfit => {
                second = second.min(without.misfit);
            }
            _ => {
                second = best.map_or(second, |(_, first)| second.min(first.misfit));
                best = Some((position, without));
            }
        }
    }
    let (position, without) = best?;
    let (square, _) = scale.of(without.misfit, rest.len() - 1);
    Some((position, without, second - without.misfit > AHEAD * square))
}

/// Returns a measurement as an outlier if its residual from where the others meet is improbable.
fn outlier(
    datum: &Datum,
    position: usize,
    meeting: &Meeting,
    (of, kept): (usize, usize),
    up: f64,
    scale: Scale,
) -> Option<Outlier> {
    let slope = datum.slope(&meeting.place, up);
    let leverage = slope.dot(&meeting.information.cholesky()?.solve(&slope));
    let residual = datum.residual(&meeting.place, up);
    let (square, degrees) = scale.of(meeting.misfit, kept);
    let student = residual / (square * (1.0 + leverage)).sqrt();
    let law = StudentsT::new(0.0, 1.0, degrees).ok()?;
    let all = f64::from(u32::try_from(of).unwrap_or(u32::MAX));
    let p = (2.0 * law.sf(student.abs()) * all).min(1.0);
    (p < OUTLIER_P).then_some(Outlier { position, residual, p })
}

/// Measurements with reversed bearings that meet where those as measured do not.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reversal {
    /// Positions of the reversed bearings.
    pub positions: Vec<usize>,
    pub meeting: Meeting,
}

/// Returns the ways in which all bearings or a single one reversed meet, with a probability of
/// their misfit of at least `least_p`; all of them first.
pub(crate) fn reversals(data: &[Datum], up: f64, least_p: f64) -> Vec<Reversal> {
    let bearings: Vec<usize> = (data.iter().enumerate())
        .filter(|(_, datum)| datum.kind == Kind::Bearing)
        .map(|(position, _)| position)
        .collect();
    let mut sets = vec![bearings.clone()];
    if (2..=EACH).contains(&bearings.len()) {
        sets.extend(bearings.into_iter().map(|position| vec![position]));
    }
    let reversal = |positions: Vec<usize>| {
        let turned: Vec<Datum> = (data.iter().enumerate())
            .map(|(at, datum)| if positions.contains(&at) { datum.reversed() } else { *datum })
            .collect();
        let meeting = meeting(&turned, up)?;
        let meets = is_near(&meeting, data) && misfit_p(meeting.misfit, data.len()) >= least_p;
        meets.then_some(Reversal { positions, meeting })
    };
    sets.into_iter().filter_map(reversal).collect()
}
