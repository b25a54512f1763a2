use foxhunt_core::{Measured, MeasuredList, Pose, Quantity};
use foxhunt_wire::{
    declination::declination_deg,
    geodesy::{Geodetic, LocalFrame, compass_deg_to_radians, grid_convergence_deg},
};
use nalgebra::{Vector2, Vector3};

use super::{
    Column, Details, FieldProblem, North, Place, Record, RecordedBearing, RecordingError, Rover,
    beyond_place,
    row::{Reader, whole},
};

/// No hunt is this wide: a place farther from the origin is a mistake in the file.
const LIMIT_KM: f64 = 200.0;

/// Distance from 0° N 0° E, in degrees, below which a place is that of a receiver without a fix.
const NO_FIX_DEG: f64 = 2e-6;

/// A row that is not kept, by the index of the rule that it is counted under.
pub(super) struct LeftOut(pub usize);

/// Measured quantities besides level and bearing: column, column of σ.
const QUANTITIES: [(Quantity, Column, Column); 3] = [
    (Quantity::RANGE, Column::RangeM, Column::RangeSigmaM),
    (Quantity::RANGE_DIFFERENCE, Column::RangeDifferenceM, Column::RangeDifferenceSigmaM),
    (Quantity::RSS_DIFFERENCE, Column::RssDifferenceDb, Column::RssDifferenceSigmaDb),
];

impl Reader<'_> {
    /// The row's record; the first row with a place sets the frame.
    pub(super) fn record(
        &self,
        frame: &mut Option<LocalFrame>,
    ) -> Result<Result<Record, LeftOut>, RecordingError> {
        if let Some(rule) = self.first_failed()? {
            return Ok(Err(LeftOut(rule)));
        }
        let rules = self.plan.rules.len();
        let rss_dbm = self.number(Column::RssDbm)?.or(self.number(Column::RssDb)?);
        let bearing_deg = self.bearing_deg_compass()?;
        let measured = self.measured()?;
        // Of a receiver whose floor is known silence is a measurement, too.
        let floor_dbm = self.number(Column::FloorDbm)?;
        let level = rss_dbm.or(floor_dbm);
        // A row without a level needs no attenuation.
        let added_db = level.map_or(Ok(0.0), |_| self.before_receiver_db())?;
        let ceiling_dbm = self.number(Column::CeilingDbm)?;
        let [rss_dbm, floor_dbm, ceiling_dbm] =
            [rss_dbm, floor_dbm, ceiling_dbm].map(|level| level.map(|l| l + added_db));
        if level.is_none() && bearing_deg.is_none() && measured.is_empty() {
            return Ok(Err(LeftOut(rules)));
        }
        let mut time = self.time()?;
        let at = self.rover;
        let position = match at {
            Some((rover, offset_s)) => {
                time = time.map(|time| time + offset_s);
                let place = time.and_then(|time| rover.place(time));
                place.map(|place| self.on_track(&place, rover, frame)).transpose()?
            }
            None => self.receiver_position(frame)?,
        };
        let has_places = self.plan.has(Column::LatDeg) || self.plan.has(Column::EastM);
        if position.is_none() && (has_places || at.is_some()) {
            return Ok(Err(LeftOut(rules + 1)));
        }
        let heading_deg = self.number(Column::HeadingDegCompass)?;
        let own_boresight_deg = self.number(Column::BoresightDegCompass)?;
        let angles = [
            (Column::BearingDegCompass, bearing_deg),
            (Column::HeadingDegCompass, heading_deg),
            (Column::BoresightDegCompass, own_boresight_deg),
        ];
        let north_deg = match angles.into_iter().find(|(_, angle)| angle.is_some()) {
            Some((column, _)) => self.north_deg(column, *frame, position)?,
            None => 0.0,
        };
        // The Earth's curvature matters to angles alone.
        let is_turned =
            !self.plan.has(Column::EastM) && angles.into_iter().any(|(_, angle)| angle.is_some());
        let on_earth = (*frame).zip(position).filter(|_| is_turned);
        let on_earth = on_earth.map(|(frame, position)| (frame, frame.to_geodetic(&position)));
        let radians = |deg: f64| match &on_earth {
            Some((frame, place)) => frame.direction(place, north_deg + deg),
            None => compass_deg_to_radians(north_deg + deg),
        };
        let bearing = match bearing_deg {
            None => None,
            Some(deg) => Some(RecordedBearing {
                angle: radians(deg),
                sigma: self.number(Column::BearingSigmaDeg)?.map(f64::to_radians),
                is_calibrated: false,
            }),
        };
        let heading = heading_deg.map_or(0.0, radians);
        let boresight_deg = match self.number(Column::AntennaDeg)? {
            None => own_boresight_deg,
            Some(antenna) => {
                let missing = || self.wrong(Column::HeadingDegCompass, FieldProblem::Missing);
                Some(heading_deg.ok_or_else(missing)? + antenna)
            }
        };
        let drone = self.text(Column::Drone)?;
        let [pitch, roll] = [self.number(Column::PitchDeg)?, self.number(Column::RollDeg)?]
            .map(|deg| deg.unwrap_or(0.0).to_radians());
        let pose = position.map(|position| Pose { pitch, roll, ..Pose::level(position, heading) });
        let details = Details {
            beacon: self.text(Column::Beacon)?.map(|name| self.shared.name(&name)),
            drone: self.shared.name(drone.as_deref().unwrap_or(self.stem)),
            receiver_sigma_m: self.number(Column::ReceiverSigmaM)?.filter(|sigma| *sigma > 0.0),
            boresight: boresight_deg.map(radians),
            position: self.number(Column::Position)?.map(whole).and_then(|i| i.try_into().ok()),
            turn: self.number(Column::Turn)?.map(whole),
            floor_dbm,
            ceiling_dbm,
            bearing,
            measured,
            known_range: if self.plan.has(Column::RangeSigmaM) {
                None
            } else {
                self.number(Column::RangeM)?
            },
            truth: self.truth(frame)?,
            tilted: pose.and_then(beyond_place),
        };
        Ok(Ok(Record {
            line: self.row.line(),
            time,
            place: position.map(|position| Place { position, heading }),
            rss_dbm,
            details: self.shared.details(details),
        }))
    }

    /// Returns how far east of true North the angles of this row are counted from, in degrees, for
    /// a receiver at `position` of the frame; `column` is the angle that needs it.
    fn north_deg(
        &self,
        column: Column,
        frame: Option<LocalFrame>,
        position: Option<Vector3<f64>>,
    ) -> Result<f64, RecordingError> {
        let in_metres = self.plan.has(Column::EastM);
        let place = || match (frame, position) {
            (Some(frame), Some(position)) => Ok(frame.to_geodetic(&position)),
            _ => Err(FieldProblem::NoPlace),
        };
        // Only a time in UTC is one of a known day.
        let unix_s = if self.plan.has(Column::TimeUtc) { self.time()? } else { None };
        let turned = match self.north {
            North::True => Ok(0.0),
            North::Stated(deg) => Ok(deg),
            North::Grid if in_metres => Ok(0.0),
            North::Grid => place().map(|place| grid_convergence_deg(&place)),
            North::Magnetic => place().and_then(|place| {
                let unix_s = unix_s.or(self.date_s).ok_or(FieldProblem::NoDate)?;
                declination_deg(&place, unix_s).map_err(FieldProblem::NoDeclination)
            }),
        };
        turned.map_err(|problem| self.wrong(column, problem))
    }

    /// A ready-made bearing, clockwise from North.
    fn bearing_deg_compass(&self) -> Result<Option<f64>, RecordingError> {
        let Some(relative) = self.number(Column::RelativeBearingDeg)? else {
            return self.number(Column::BearingDegCompass);
        };
        let heading = self.number(Column::HeadingDegCompass)?;
        let missing = || self.wrong(Column::HeadingDegCompass, FieldProblem::Missing);
        Ok(Some(heading.ok_or_else(missing)? + relative))
    }

    /// A place on a track; the track's begin is the frame's origin unless a frame is set.
    fn on_track(
        &self,
        place: &Geodetic,
        rover: &Rover,
        frame: &mut Option<LocalFrame>,
    ) -> Result<Vector3<f64>, RecordingError> {
        let here = match *frame {
            Some(frame) => frame,
            None => LocalFrame::new(rover.begin())
                .map_err(|_| self.wrong(Column::LatDeg, FieldProblem::NotFinite))?,
        };
        let local = here.to_local(place);
        let both = || format!("{}, {}", place.lat_deg, place.lon_deg);
        self.near_origin(&local, || rover.file().to_owned(), both)?;
        *frame = Some(here);
        Ok(local)
    }

    /// Refuses a place that is too far from the frame's origin.
    fn near_origin(
        &self,
        local: &Vector3<f64>,
        column: impl Fn() -> String,
        value: impl Fn() -> String,
    ) -> Result<(), RecordingError> {
        let distance_km = local.norm() / 1e3;
        if distance_km.is_nan() || distance_km > LIMIT_KM {
            let problem = FieldProblem::TooFar { distance_km, limit_km: LIMIT_KM };
            return Err(self.row.wrong(&column(), &value(), problem));
        }
        Ok(())
    }

    /// Returns the quantities besides level and bearing; a quantity is measured where it has a σ.
    fn measured(&self) -> Result<MeasuredList, RecordingError> {
        let mut values = Vec::new();
        for (quantity, column, sigma_column) in QUANTITIES {
            if !self.plan.has(sigma_column) {
                continue;
            }
            let Some(value) = self.number(column)? else { continue };
            let sigma = self.number(sigma_column)?;
            let sigma = sigma.ok_or_else(|| self.wrong(sigma_column, FieldProblem::Missing))?;
            let measured = Measured::new(quantity, value, sigma);
            let refused = |_| self.wrong(column, FieldProblem::NotAMeasurement);
            values.push(measured.map_err(refused)?);
        }
        let refused = |_| self.wrong(Column::RangeM, FieldProblem::NotAMeasurement);
        MeasuredList::new(&values).map_err(refused)
    }

    fn receiver_position(
        &self,
        frame: &mut Option<LocalFrame>,
    ) -> Result<Option<Vector3<f64>>, RecordingError> {
        let above_ground = self.number(Column::AltAglM)?.or(self.number(Column::UpM)?);
        if let Some((east, north)) = self.pair(Column::EastM, Column::NorthM)? {
            return Ok(Some(Vector3::new(east, north, above_ground.unwrap_or(0.0))));
        }
        let altitude = self.number(Column::AltM)?;
        let Some(local) = self.local(Column::LatDeg, Column::LonDeg, altitude, frame)? else {
            return Ok(None);
        };
        // A height above the ground is taken as it is: the ground follows the Earth, not the frame.
        let up = above_ground.unwrap_or(if altitude.is_some() { local.z } else { 0.0 });
        Ok(Some(Vector3::new(local.x, local.y, up)))
    }

    fn truth(
        &self,
        frame: &mut Option<LocalFrame>,
    ) -> Result<Option<Vector2<f64>>, RecordingError> {
        if let Some((east, north)) = self.pair(Column::TruthEastM, Column::TruthNorthM)? {
            return Ok(Some(Vector2::new(east, north)));
        }
        let local = self.local(Column::TruthLatDeg, Column::TruthLonDeg, None, frame)?;
        Ok(local.map(|local| local.xy()))
    }

    /// A place in the local frame, at the origin's height unless it has its own.
    fn local(
        &self,
        lat: Column,
        lon: Column,
        altitude: Option<f64>,
        frame: &mut Option<LocalFrame>,
    ) -> Result<Option<Vector3<f64>>, RecordingError> {
        // Before the bounds of each: a latitude that is a longitude gets its own message.
        if let Some(swapped) = self.swapped(lat, lon) {
            return Err(swapped);
        }
        let Some((lat_deg, lon_deg)) = self.pair(lat, lon)? else { return Ok(None) };
        let columns = || format!("{}, {}", self.plan.label(lat), self.plan.label(lon));
        let both = || format!("{lat_deg}, {lon_deg}");
        if lat_deg.abs() < NO_FIX_DEG && lon_deg.abs() < NO_FIX_DEG {
            return Err(self.row.wrong(&columns(), &both(), FieldProblem::NoFix));
        }
        let at_origin = frame.map_or(0.0, |frame| frame.origin().alt_m);
        let place = Geodetic { lat_deg, lon_deg, alt_m: altitude.unwrap_or(at_origin) };
        let here = match *frame {
            Some(frame) => frame,
            None => LocalFrame::new(place).map_err(|_| self.wrong(lat, FieldProblem::NotFinite))?,
        };
        let local = here.to_local(&place);
        let turned = Geodetic { lat_deg: lon_deg, lon_deg: lat_deg, ..place };
        let is_near = |local: Vector3<f64>| local.norm() <= LIMIT_KM * 1e3;
        if !is_near(local) {
            self.astray.set(self.astray.get().or(Some(place)));
        }
        if !is_near(local) && is_near(here.to_local(&turned)) {
            let problem = FieldProblem::SwappedPlace { distance_km: local.norm() / 1e3 };
            return Err(self.row.wrong(&columns(), &both(), problem));
        }
        self.near_origin(&local, columns, both)?;
        *frame = Some(here);
        Ok(Some(local))
    }

    fn swapped(&self, lat: Column, lon: Column) -> Option<RecordingError> {
        let parse = |column| self.row.parse(self.text(column).ok()??.as_ref());
        let swapped = parse(lat)?.abs() > 90.0 && parse(lat)?.abs() <= 180.0;
        (swapped && parse(lon)?.abs() <= 90.0).then(|| self.wrong(lat, FieldProblem::Swapped))
    }
}
