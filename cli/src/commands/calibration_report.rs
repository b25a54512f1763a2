//! The report of `foxhunt calibrate`.

use foxhunt::{
    calibration::{BearingSection, CalibrationFile, StationAntennaSection},
    core::nalgebra::Vector3,
    geodesy::radians_to_compass_deg,
    recorded::{ArrayCalibration, BearingsFit, Calibration, StationCalibration},
    recording::Recording,
    sensors::{BearingOffsetFit, SigmaFit, StationAntenna, StationDoubt},
};
use serde::Serialize;

use crate::table::{number, table, text as cell};

/// The fits in JSON.
#[derive(Debug, Serialize)]
pub struct Report {
    #[serde(rename = "calibration")]
    pub file: CalibrationFile,
    #[serde(rename = "file")]
    first_file: String,
    files: Vec<String>,
    beacon: Option<String>,
    /// True if levels are in dBm, and not about an unknown reference.
    calibrated: bool,
    #[serde(flatten)]
    path_loss: Option<PathLoss>,
    bearings: Option<Bearings>,
    /// Arrays that do not turn, in the order of the file.
    pub arrays: Vec<Array>,
    /// Stations in the order of the file.
    pub stations: Vec<Station>,
    /// Fits that were not possible.
    pub skipped: Vec<Skipped>,
}

/// Something that could not be fitted.
#[derive(Debug, Serialize)]
pub struct Skipped {
    pub what: &'static str,
    pub why: String,
}

/// A fitted path loss.
#[derive(Debug, Serialize)]
struct PathLoss {
    p0_dbm: f64,
    p0_standard_error_db: f64,
    p0_interval_95: Option<[f64; 2]>,
    exponent: f64,
    /// Standard error of the exponent; absent if the exponent is at its bound, as are all the
    /// fields below but the covariance.
    exponent_standard_error: Option<f64>,
    exponent_interval_95: Option<[f64; 2]>,
    correlation: Option<f64>,
    covariance: [[f64; 2]; 2],
    region_95: Option<Region>,
    at_bound: bool,
    rmse_db: f64,
    sigma_db: f64,
    points: usize,
    nearest_m: f64,
    farthest_m: f64,
}

/// The ellipse that holds P₀ and the exponent together: P₀ in dB along the first axis, the exponent
/// along the second.
#[derive(Debug, Serialize)]
struct Region {
    semi_major: f64,
    semi_minor: f64,
    orientation_deg: f64,
}

/// Errors of bearings.
#[derive(Debug, Serialize)]
struct Bearings {
    bearings: usize,
    refused: usize,
    offset: Option<Offset>,
    /// The offset with its first harmonic over the heading, even if it is not used.
    heading: Option<Offset>,
    sigma: Option<Sigma>,
    used: Option<BearingSection>,
}

/// A fitted offset, in degrees counter-clockwise.
#[derive(Debug, Serialize)]
struct Offset {
    offset_deg_ccw: f64,
    sin_heading_deg: f64,
    cos_heading_deg: f64,
    standard_errors_deg: [f64; 3],
    half_intervals_95_deg: Option<[f64; 3]>,
    rms_deg: f64,
    /// The probability of such a harmonic by chance.
    harmonic_p_value: Option<f64>,
}

/// σ against errors.
#[derive(Debug, Serialize)]
struct Sigma {
    scale: f64,
    scale_interval_95: [f64; 2],
    floor_deg: f64,
    floor_interval_95_deg: [f64; 2],
    rms_ratio: f64,
    coverage_95: f64,
    fitted_coverage_95: f64,
    correlation: Option<f64>,
    correlation_p_value: Option<f64>,
}

/// Deviation of an array that does not turn.
#[derive(Debug, Serialize)]
pub struct Array {
    bearings: usize,
    /// Number of bearings left out of the fit, as of reflections.
    outliers: usize,
    /// Number of bearings to transmitters without a known place.
    unknown: usize,
    harmonics: usize,
    /// Gain in the log-evidence over a constant.
    log_gain: f64,
    rms_before_deg: f64,
    rms_deg: f64,
    sigma_deg: f64,
    /// Deviation every 30° from the array's nose, counter-clockwise, with half the 95 % interval.
    deviations: Vec<DeviationAt>,
    /// The bearings' own σ, if they have any.
    sigma: Option<Sigma>,
}

/// Deviation at a measured direction, in degrees counter-clockwise.
#[derive(Debug, Serialize)]
struct DeviationAt {
    direction_deg: f64,
    deviation_deg: f64,
    half_interval_95_deg: f64,
}

/// Directions at which the deviation is shown, in degrees.
const SHOWN_EVERY_DEG: u16 = 30;

impl From<&ArrayCalibration> for Array {
    fn from(calibration: &ArrayCalibration) -> Self {
        let fit = &calibration.fit;
        let at = |number: u16| {
            let direction_deg = f64::from(number * SHOWN_EVERY_DEG);
            let direction = direction_deg.to_radians();
            DeviationAt {
                direction_deg,
                deviation_deg: fit.deviation.at(direction).to_degrees(),
                half_interval_95_deg: 1.96 * fit.deviation.sigma_at(direction).to_degrees(),
            }
        };
        Self {
            bearings: fit.points,
            outliers: fit.outliers,
            unknown: calibration.unknown,
            harmonics: fit.deviation.harmonics().len(),
            log_gain: fit.log_gain,
            rms_before_deg: calibration.rms_before.to_degrees(),
            rms_deg: fit.rms.to_degrees(),
            sigma_deg: fit.sigma.to_degrees(),
            deviations: (0..360 / SHOWN_EVERY_DEG).map(at).collect(),
            sigma: calibration.sigma.as_ref().map(Sigma::from),
        }
    }
}

/// A station's antennas, and how well they do on days that were left out.
#[derive(Debug, Serialize)]
pub struct Station {
    bursts: usize,
    groups: usize,
    /// Numbers that the bursts did not determine, for which the station takes the common model.
    doubts: Vec<String>,
    /// Bearings of groups left out of the fit; absent if there are too few.
    #[serde(flatten)]
    left_out: Option<LeftOut>,
}

/// Bearings of groups that were left out of the fit.
#[derive(Debug, Serialize)]
struct LeftOut {
    bearings: usize,
    refused: usize,
    median_error_deg: f64,
    coverage_95: f64,
    sigma: Sigma,
}

impl Report {
    pub fn new(recordings: &[Recording], beacon: Option<String>) -> Self {
        let files: Vec<String> = recordings.iter().map(|r| r.file().to_owned()).collect();
        let file = CalibrationFile {
            recordings: files.clone(),
            beacon: beacon.clone(),
            ..CalibrationFile::default()
        };
        Self {
            file,
            first_file: files.first().cloned().unwrap_or_default(),
            files,
            beacon,
            calibrated: recordings.iter().all(Recording::is_calibrated),
            path_loss: None,
            bearings: None,
            arrays: Vec::new(),
            stations: Vec::new(),
            skipped: Vec::new(),
        }
    }

    pub fn beacon(&self) -> Option<&str> {
        self.beacon.as_deref()
    }

    pub fn skip(&mut self, what: &'static str, why: String) {
        self.skipped.push(Skipped { what, why });
    }

    pub fn path_loss(&mut self, calibration: &Calibration) {
        let fit = &calibration.fit;
        let c = &fit.covariance;
        self.path_loss = Some(PathLoss {
            p0_dbm: fit.reference_dbm,
            p0_standard_error_db: fit.reference_error_db(),
            p0_interval_95: fit.reference_interval(0.95),
            exponent: fit.exponent,
            exponent_standard_error: (!fit.at_bound).then(|| fit.exponent_error()),
            exponent_interval_95: fit.exponent_interval(0.95),
            correlation: (!fit.at_bound).then(|| fit.correlation()),
            covariance: [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]],
            region_95: fit.region(0.95).map(|ellipse| Region {
                semi_major: ellipse.semi_major,
                semi_minor: ellipse.semi_minor,
                orientation_deg: ellipse.orientation.to_degrees(),
            }),
            at_bound: fit.at_bound,
            rmse_db: fit.rmse_db,
            sigma_db: fit.sigma_db,
            points: fit.points,
            nearest_m: calibration.nearest_m,
            farthest_m: calibration.farthest_m,
        });
    }

    pub fn bearings(&mut self, fit: &BearingsFit) {
        for (what, error) in [
            ("offset of bearings", fit.constant.as_ref().err()),
            ("offset over the heading", fit.heading.as_ref().err()),
            ("σ of bearings", fit.sigma.as_ref().err()),
        ] {
            if let Some(error) = error {
                self.skip(what, error.to_string());
            }
        }
        self.bearings = Some(Bearings {
            bearings: fit.bearings,
            refused: fit.refused,
            offset: fit.constant.as_ref().ok().map(Offset::from),
            heading: fit.heading.as_ref().ok().map(Offset::from),
            sigma: fit.sigma.as_ref().ok().map(Sigma::from),
            used: self.file.bearings.clone(),
        });
    }
}

impl From<&BearingOffsetFit> for Offset {
    fn from(fit: &BearingOffsetFit) -> Self {
        let degrees = |v: Vector3<f64>| v.map(f64::to_degrees).into();
        Self {
            offset_deg_ccw: fit.offset.constant.to_degrees(),
            sin_heading_deg: fit.offset.sin_heading.to_degrees(),
            cos_heading_deg: fit.offset.cos_heading.to_degrees(),
            standard_errors_deg: degrees(fit.standard_errors()),
            half_intervals_95_deg: fit.half_intervals(0.95).map(degrees),
            rms_deg: fit.rms.to_degrees(),
            harmonic_p_value: fit.harmonic_p_value(),
        }
    }
}

impl From<&SigmaFit> for Sigma {
    fn from(fit: &SigmaFit) -> Self {
        Self {
            scale: fit.scale,
            scale_interval_95: fit.scale_interval,
            floor_deg: fit.floor.to_degrees(),
            floor_interval_95_deg: fit.floor_interval.map(f64::to_degrees),
            rms_ratio: fit.rms_ratio,
            coverage_95: fit.coverage_95,
            fitted_coverage_95: fit.fitted_coverage_95,
            correlation: fit.correlation,
            correlation_p_value: fit.correlation_p_value,
        }
    }
}

impl From<&StationCalibration> for Station {
    fn from(station: &StationCalibration) -> Self {
        let left_out = station.cross_validation.as_ref().map(|left_out| LeftOut {
            bearings: left_out.bearings,
            refused: left_out.refused,
            median_error_deg: left_out.median_error.to_degrees(),
            coverage_95: left_out.coverage_95,
            sigma: Sigma::from(&left_out.sigma),
        });
        let fit = &station.fit;
        Self {
            bursts: fit.groups.len(),
            groups: station.groups,
            doubts: fit.doubts.iter().map(|own| doubt(own, fit.pattern.antennas())).collect(),
            left_out,
        }
    }
}

fn doubt(of: &StationDoubt, antennas: &[StationAntenna]) -> String {
    let recorded = |antenna: usize| {
        let own = antennas.get(antenna);
        own.map_or(f64::NAN, |own| radians_to_compass_deg(own.recorded_boresight))
    };
    match *of {
        StationDoubt::Boresight { antenna, half_interval } => format!(
            "the boresight of the antenna recorded at {:.0}° is not known (± {:.0}°)",
            recorded(antenna),
            half_interval.to_degrees()
        ),
        StationDoubt::Gain { antenna, gain_db, believed_db } => format!(
            "the gain of the antenna recorded at {:.0}° is {gain_db:.1} dB, beyond the \
             {believed_db:.1} dB that those of all stations make believable",
            recorded(antenna)
        ),
    }
}

pub fn text(report: &Report) -> String {
    let mut lines = Vec::new();
    lines.extend(report.path_loss.as_ref().map(|fit| path_loss(fit, report.calibrated)));
    lines.extend(report.bearings.as_ref().map(bearings));
    for (array, section) in report.arrays.iter().zip(&report.file.arrays) {
        lines.push(deviation(array, section.name.as_deref()));
    }
    for (station, section) in report.stations.iter().zip(&report.file.stations) {
        lines.extend(section.name.as_ref().map(|name| format!("station {name}:")));
        lines.push(antennas(&section.antennas));
        lines.push(format!(
            "beamwidth {:.0}°, front to back {:.1} dB, residual {:.1} dB; {} bursts in {} groups",
            section.beamwidth_deg,
            section.front_to_back_db,
            section.residual_db,
            station.bursts,
            station.groups
        ));
        let doubts = station.doubts.iter();
        lines.extend(doubts.map(|doubt| format!("{doubt}: the station takes the common model")));
        lines.extend(station.left_out.as_ref().map(|left_out| {
            format!(
                "With each group left out of the fit: median error {:.1}°, {:.1} % within 1.96 σ, \
                 rms(error/σ) {:.2}; {} bearings, {} refused",
                left_out.median_error_deg,
                100.0 * left_out.coverage_95,
                left_out.sigma.rms_ratio,
                left_out.bearings,
                left_out.refused
            )
        }));
    }
    if let Some(model) = &report.file.station_model {
        lines.push(format!(
            "All stations: boresights are recorded to within {:.1}° (1 σ), gains to within {:.1} \
             dB; residual {:.1} dB where nothing else is known. Stations without a section of \
             their own are taken so.",
            model.boresight_sigma_deg, model.gain_sigma_db, model.residual_db
        ));
    }
    let skipped = report.skipped.iter().map(|s| format!("not fitted: {}: {}", s.what, s.why));
    lines.extend(skipped);
    lines.join("\n")
}

fn path_loss(fit: &PathLoss, calibrated: bool) -> String {
    let unit = if calibrated { "dBm" } else { "dB" };
    let interval = |at: Option<[f64; 2]>, decimals: usize| {
        cell(at.map(|[low, high]| format!("{low:.decimals$} to {high:.decimals$}")))
    };
    let mut fitted = table(&["parameter", "value", "standard error", "95 %"]);
    fitted.add_row([
        format!("P₀ {unit}"),
        number(fit.p0_dbm, 2),
        number(fit.p0_standard_error_db, 2),
        interval(fit.p0_interval_95, 2),
    ]);
    fitted.add_row([
        "exponent γ".to_owned(),
        number(fit.exponent, 3),
        number(fit.exponent_standard_error, 3),
        interval(fit.exponent_interval_95, 3),
    ]);
    let mut lines = vec![fitted.to_string()];
    lines.push(format!(
        "{} points from {:.1} m to {:.1} m; RMSE {:.2} dB, σ {:.2} dB",
        fit.points, fit.nearest_m, fit.farthest_m, fit.rmse_db, fit.sigma_db
    ));
    if let (Some(region), Some(correlation)) = (&fit.region_95, fit.correlation) {
        let [[a, b], [_, c]] = fit.covariance;
        lines.push(format!(
            "P₀ and γ together, 95 %: an ellipse with semi-axes {:.3} and {:.4}, the longer one \
             {:.2}° from the P₀ axis; correlation {correlation:.3}, covariance [{a:.4}, {b:.5}; \
             {b:.5}, {c:.6}]",
            region.semi_major, region.semi_minor, region.orientation_deg
        ));
    }
    if fit.at_bound {
        lines.push("The exponent is held by --max-exponent.".to_owned());
    }
    if !calibrated {
        lines.push("The levels are about an unknown reference, and so is P₀.".to_owned());
    }
    lines.join("\n")
}

fn bearings(fit: &Bearings) -> String {
    let mut errors = table(&["bearings", "offset °", "sin h °", "cos h °", "rms °", "p"]);
    let of = |value: f64, half: Option<f64>| match half {
        Some(half) => format!("{value:.2} ± {half:.2}"),
        None => format!("{value:.2}"),
    };
    for (name, offset) in [("constant", &fit.offset), ("over heading", &fit.heading)] {
        let Some(offset) = offset else { continue };
        let half = |i: usize| offset.half_intervals_95_deg.map(|half| half[i]);
        let harmonic = offset.harmonic_p_value.is_some();
        errors.add_row([
            name.to_owned(),
            of(offset.offset_deg_ccw, half(0)),
            cell(harmonic.then(|| of(offset.sin_heading_deg, half(1)))),
            cell(harmonic.then(|| of(offset.cos_heading_deg, half(2)))),
            number(offset.rms_deg, 2),
            number(offset.harmonic_p_value, 4),
        ]);
    }
    let mut lines = vec![errors.to_string()];
    lines.push(format!(
        "{} bearings, {} turns without; measured minus true, counter-clockwise, ± 95 %, h from \
         East",
        fit.bearings, fit.refused
    ));
    if let Some(sigma) = &fit.sigma {
        let [low, high] = sigma.scale_interval_95;
        let [floor_low, floor_high] = sigma.floor_interval_95_deg;
        lines.push(format!(
            "σ × {:.3} ({low:.3} to {high:.3}), floor {:.2}° ({floor_low:.2} to {floor_high:.2}); \
             as it was: rms(error/σ) {:.2}, {:.1} % within 1.96 σ",
            sigma.scale,
            sigma.floor_deg,
            sigma.rms_ratio,
            100.0 * sigma.coverage_95
        ));
        if let (Some(r), Some(p)) = (sigma.correlation, sigma.correlation_p_value) {
            lines.push(format!("correlation of σ and |error| {r:.2}, p = {p:.4}"));
        }
    }
    lines.join("\n")
}

/// Returns the table of an array's deviation, and how well it fits.
fn deviation(array: &Array, name: Option<&str>) -> String {
    let mut rows = table(&["direction ° from the nose", "measured minus true °", "± 95 %"]);
    for at in &array.deviations {
        rows.add_row([
            number(at.direction_deg, 0),
            number(at.deviation_deg, 2),
            number(at.half_interval_95_deg, 2),
        ]);
    }
    let whose = name.map_or_else(String::new, |name| format!(" {name}"));
    let harmonics = match array.harmonics {
        1 => "1 harmonic".to_owned(),
        count => format!("{count} harmonics"),
    };
    let unknown = match array.unknown {
        0 => String::new(),
        count => format!(", {count} of transmitters at unknown places"),
    };
    format!(
        "array{whose}, which does not turn:\n{rows}\n{harmonics} over the measured direction, \
         counter-clockwise; {} bearings, {} left out as outliers{unknown}; rms {:.2}° before, \
         {:.2}° after; σ {:.2}°",
        array.bearings, array.outliers, array.rms_before_deg, array.rms_deg, array.sigma_deg
    )
}

fn antennas(antennas: &[StationAntennaSection]) -> String {
    let mut rows = table(&["antenna recorded at °", "looks to ° compass", "± 95 %", "gain dB"]);
    for antenna in antennas {
        rows.add_row([
            number(antenna.recorded_deg_compass, 0),
            number(antenna.boresight_deg_compass, 1),
            number(antenna.half_interval_deg, 1),
            number(antenna.gain_db, 1),
        ]);
    }
    rows.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubts_name_the_antenna_as_it_was_recorded() {
        // East is 90° on the compass.
        let antennas = [StationAntenna::as_recorded(0.0)];
        let wide = StationDoubt::Boresight { antenna: 0, half_interval: 6.772 };
        assert_eq!(
            doubt(&wide, &antennas),
            "the boresight of the antenna recorded at 90° is not known (± 388°)"
        );
        let deaf = StationDoubt::Gain { antenna: 0, gain_db: -31.04, believed_db: 10.5 };
        assert_eq!(
            doubt(&deaf, &antennas),
            "the gain of the antenna recorded at 90° is -31.0 dB, beyond the 10.5 dB that those \
             of all stations make believable"
        );
    }
}
