use foxhunt::{
    core::Estimate,
    geodesy::Geodetic,
    hunt::PlaceEstimate,
    overview::SearchOverview,
    page::{NotStrikable, PageLog},
    struck::RowId,
};
use serde::Serialize;

/// An estimate on Earth and in the local frame.
#[derive(Debug, Serialize)]
pub(super) struct Estimated {
    /// Latitude; absent if the recordings are in local metres.
    pub(super) lat_deg: Option<f64>,
    pub(super) lon_deg: Option<f64>,
    pub(super) east_m: f64,
    pub(super) north_m: f64,
    pub(super) covariance_m2: [[f64; 2]; 2],
}

impl Estimated {
    pub(super) fn new(estimate: &Estimate<2>, on_earth: Option<Geodetic>) -> Self {
        Self {
            lat_deg: on_earth.map(|place| place.lat_deg),
            lon_deg: on_earth.map(|place| place.lon_deg),
            east_m: estimate.mean.x,
            north_m: estimate.mean.y,
            covariance_m2: PlaceEstimate::from(estimate).covariance_m2,
        }
    }
}

/// Place or track of a beacon, for the page and for exports.
pub(super) struct Found {
    pub(super) beacon: Option<String>,
    /// Name of the estimator.
    pub(super) method: String,
    pub(super) search: SearchOverview,
    /// Data with which a page tracks it again, if it is tracked.
    pub(super) tracks: Option<Result<PageLog, NotStrikable>>,
    /// Rows that belong to it, where not all of its beacon do.
    pub(super) rows: Option<Vec<RowId>>,
}

/// Rows that belong to no transmitter: some of a beacon, or all of them without a list.
pub(super) struct Others<'a> {
    pub(super) beacon: Option<&'a str>,
    pub(super) rows: Option<&'a [RowId]>,
}

/// Returns the value with the largest probability, and that probability.
pub(super) fn likeliest(values: &[(f64, f64)]) -> (f64, f64) {
    let best = values.iter().max_by(|a, b| a.1.total_cmp(&b.1)).copied();
    best.unwrap_or((f64::NAN, f64::NAN))
}
