//! Receivers that nothing flies: a person, a car or a boat carries them, or they stand somewhere.

use std::{f64::consts::SQRT_2, fmt, io};

use foxhunt_core::{
    Pose, Spinner, Vehicle, Waypoint,
    parameter::{FieldError, finite, not_negative, positive},
};
use foxhunt_wire::{
    ByteStream, FixQuality,
    geodesy::{Geodetic, LocalFrame, compass_deg_to_radians},
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{GnssError, GnssPosition, HeightOrigin, Positioning, angle_field, sentence};
use crate::{Aircraft, AircraftState, Hands};

/// σ of the height of an antenna that somebody carries over level ground, in metres.
const CARRIED_UP_SIGMA_M: f64 = 0.5;

/// Time in seconds after which a goal is sent to the guide once more: a datagram may be lost, and a
/// plotter may be switched on late.
const REPEATED_S: f64 = 5.0;

/// Settings of a receiver that a person, a car or a boat carries.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CarriedConfig {
    /// Height of the antenna above the ground, in metres. The height of the GNSS is not used.
    pub up_m: f64,
    /// Direction of the nose in degrees clockwise from true North, for a carrier that keeps it. If
    /// absent, the heading is that of a compass, or else the course over the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading_deg_compass: Option<f64>,
    /// Least speed in metres per second at which the course over the ground is the heading; below
    /// it the last one stays.
    pub course_from_mps: f64,
    /// Speed at which it is carried, in metres per second, for the plan.
    pub speed_mps: f64,
}

impl Default for CarriedConfig {
    /// 1.5 m up, heading by compass or course from 0.7 m/s on, at a walk of 1.4 m/s.
    fn default() -> Self {
        Self { up_m: 1.5, heading_deg_compass: None, course_from_mps: 0.7, speed_mps: 1.4 }
    }
}

impl CarriedConfig {
    /// Refuses what cannot be.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field and its value.
    pub fn check(&self) -> Result<(), FieldError> {
        finite("up_m", self.up_m)?;
        finite("heading_deg_compass", self.heading_deg_compass.unwrap_or(0.0))?;
        not_negative("course_from_mps", self.course_from_mps)?;
        positive("speed_mps", self.speed_mps)?;
        Ok(())
    }
}

/// Settings of a station that stands at a surveyed place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FixedConfig {
    /// Height of the antenna above the ground, in metres.
    pub up_m: f64,
    /// Direction in degrees clockwise from true North to which the front of its antenna or array
    /// looks; that of a rotator's zero.
    pub heading_deg_compass: f64,
    /// σ of its place on each axis, in metres.
    pub sigma_m: f64,
}

impl Default for FixedConfig {
    /// 3 m up, its front to the North, known to 1 m.
    fn default() -> Self {
        Self { up_m: 3.0, heading_deg_compass: 0.0, sigma_m: 1.0 }
    }
}

impl FixedConfig {
    /// Refuses what cannot be.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field and its value.
    pub fn check(&self) -> Result<(), FieldError> {
        finite("up_m", self.up_m)?;
        finite("heading_deg_compass", self.heading_deg_compass)?;
        not_negative("sigma_m", self.sigma_m)?;
        Ok(())
    }
}

/// A surveyed place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    place: Geodetic,
    sigma_m: f64,
}

impl Mark {
    /// A place with σ on each axis in metres.
    #[must_use]
    pub fn new(place: Geodetic, sigma_m: f64) -> Self {
        Self { place, sigma_m }
    }
}

impl Positioning for Mark {
    fn position(&mut self) -> Result<GnssPosition, GnssError> {
        Ok(GnssPosition {
            place: self.place,
            height: HeightOrigin::Fix,
            sigma_m: Vector3::repeat(self.sigma_m),
            velocity_mps: Some(Vector3::zeros()),
            heading: None,
            quality: FixQuality::RtkFixed,
            age_s: 0.0,
        })
    }
}

/// A receiver that nothing flies: in the hands of a person, on a car or a boat, or at a fixed
/// place.
///
/// An order moves nothing. It is kept as the [`goal`](Self::goal), which is shown to the person who
/// walks there, or does not, and is sent to a [guide](Self::with_guide).
///
/// The pose is an error while the heading is unknown ([`CarriedError::NoHeading`]), as bearings by
/// a guessed heading would be wrong by any angle. An antenna without a direction needs no heading
/// ([`omnidirectional`](Self::omnidirectional)).
pub struct CarriedVehicle<G> {
    config: CarriedConfig,
    gnss: G,
    frame: LocalFrame,
    /// Place of the antenna of the GNSS from the middle: forward, left and up.
    antenna: Vector3<f64>,
    guide: Option<Guide>,
    /// Direction of the nose; `None` before a compass or a course is known.
    heading: Option<f64>,
    /// True if the antenna has no direction.
    omnidirectional: bool,
    goal: Option<Waypoint>,
    sigma: Option<Vector3<f64>>,
    /// True if it never goes anywhere.
    rooted: bool,
    /// True once its place was known.
    began: bool,
    dismissed: bool,
}

impl<G> fmt::Debug for CarriedVehicle<G> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CarriedVehicle")
            .field("config", &self.config)
            .field("heading", &self.heading)
            .field("goal", &self.goal)
            .field("rooted", &self.rooted)
            .finish_non_exhaustive()
    }
}

/// Stream to a plotter or a telephone, and the goal that was sent last.
struct Guide {
    stream: Box<dyn ByteStream>,
    sent: Option<SentGoal>,
}

/// Goal that a guide got.
struct SentGoal {
    goal: Waypoint,
    /// Time by the clock of the GNSS, if that has one.
    at_s: Option<f64>,
    connections: u32,
}

impl Guide {
    /// Sends a goal, unless this connection got it lately.
    fn show(&mut self, goal: &Waypoint, frame: &LocalFrame, now_s: Option<f64>) -> io::Result<()> {
        let connections = self.stream.connections();
        let is_recent = |sent: &SentGoal| {
            let age_s = now_s.zip(sent.at_s).map_or(0.0, |(now_s, at_s)| now_s - at_s);
            sent.goal == *goal && sent.connections == connections && age_s < REPEATED_S
        };
        if self.sent.as_ref().is_some_and(is_recent) {
            return Ok(());
        }
        let place = frame.to_geodetic(&goal.position);
        self.stream.send(waypoint(&place).as_bytes())?;
        // Sending may have opened the stream.
        let connections = self.stream.connections();
        self.sent = Some(SentGoal { goal: *goal, at_s: now_s, connections });
        Ok(())
    }
}

/// Error of a carried receiver.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CarriedError {
    /// The place of the receiver is unknown.
    #[error(transparent)]
    Gnss(#[from] GnssError),
    /// The heading is unknown, and the antenna has a direction.
    #[error("the heading is unknown: walk some metres, add a compass, or set heading_deg_compass")]
    NoHeading,
    /// The guide that goals are sent to cannot be reached.
    #[error("the guide that goals are sent to: {0}")]
    Guide(io::Error),
}

impl CarriedVehicle<Mark> {
    /// A station at a place of the frame, East and North in metres, that never goes anywhere.
    #[must_use]
    pub fn fixed(config: FixedConfig, [east_m, north_m]: [f64; 2], frame: LocalFrame) -> Self {
        let place = frame.to_geodetic(&Vector3::new(east_m, north_m, config.up_m));
        let carried = CarriedConfig {
            up_m: config.up_m,
            heading_deg_compass: Some(config.heading_deg_compass),
            ..CarriedConfig::default()
        };
        let mut station = Self::new(carried, Mark::new(place, config.sigma_m), frame);
        station.rooted = true;
        station
    }
}

impl<G> CarriedVehicle<G> {
    /// A receiver that is carried. `frame` is that of all poses. Its antenna has a direction, so
    /// that it has no pose before a compass or a course is known.
    pub fn new(config: CarriedConfig, gnss: G, frame: LocalFrame) -> Self {
        let heading = config.heading_deg_compass.map(compass_deg_to_radians);
        Self {
            config,
            gnss,
            frame,
            antenna: Vector3::zeros(),
            guide: None,
            heading,
            omnidirectional: false,
            goal: None,
            sigma: None,
            rooted: false,
            began: false,
            dismissed: false,
        }
    }

    /// Sets the place of the antenna of the GNSS from the middle: forward, left and up in metres.
    #[must_use]
    pub fn with_antenna(self, antenna: Vector3<f64>) -> Self {
        Self { antenna, ..self }
    }

    /// Sends each goal to a plotter, a telephone or a simulated walker, as a sentence WPL of NMEA
    /// 0183 of the waypoint `NEXT`.
    ///
    /// It is sent again every 5 s by the clock of the GNSS, and on a new connection. A goal that
    /// could not be sent is sent at the next pose.
    #[must_use]
    pub fn with_guide(self, guide: Box<dyn ByteStream>) -> Self {
        Self { guide: Some(Guide { stream: guide, sent: None }), ..self }
    }

    /// Declares an antenna without a direction: there is a pose while the heading is unknown, whose
    /// heading is then 0. σ grows by the distance of the GNSS's antenna from the middle.
    #[must_use]
    pub fn omnidirectional(self) -> Self {
        Self { omnidirectional: true, ..self }
    }

    /// Sets the direction of its nose, in radians counter-clockwise from East, until a compass or a
    /// course changes it.
    pub fn set_heading(&mut self, heading: f64) {
        self.heading = Some(heading);
    }

    /// The last goal.
    pub fn goal(&self) -> Option<Waypoint> {
        self.goal
    }

    /// The receiver.
    pub fn gnss(&mut self) -> &mut G {
        &mut self.gnss
    }
}

impl<G: Positioning> Vehicle for CarriedVehicle<G> {
    type Error = CarriedError;

    fn pose(&mut self) -> Result<Pose, CarriedError> {
        self.sigma = None;
        if let Some((guide, goal)) = self.guide.as_mut().zip(self.goal) {
            // It is sent again at the next pose; the place does not depend on it.
            let _ = guide.show(&goal, &self.frame, self.gnss.clock_s());
        }
        let position = self.gnss.position()?;
        self.began = true;
        let up_sigma = if self.rooted { position.sigma_m.z } else { CARRIED_UP_SIGMA_M };
        let velocity =
            position.velocity_mps.map(|velocity| Vector3::new(velocity.x, velocity.y, 0.0));
        if self.config.heading_deg_compass.is_none() {
            let moves = velocity.filter(|v| v.norm() >= self.config.course_from_mps);
            let course = moves.filter(|v| v.norm() > 0.0).map(|v| v.y.atan2(v.x));
            self.heading = position.heading.or(course).or(self.heading);
        }
        let mut middle = self.frame.to_local(&position.place);
        let mut sigma = Vector3::new(position.sigma_m.x, position.sigma_m.y, up_sigma);
        if let Some(heading) = self.heading {
            let (sin, cos) = heading.sin_cos();
            middle.x -= cos * self.antenna.x - sin * self.antenna.y;
            middle.y -= sin * self.antenna.x + cos * self.antenna.y;
        } else if self.omnidirectional {
            // The middle is anywhere on a circle around the antenna of the GNSS.
            let around = self.antenna.xy().norm() / SQRT_2;
            sigma.x = sigma.x.hypot(around);
            sigma.y = sigma.y.hypot(around);
        } else {
            return Err(CarriedError::NoHeading);
        }
        middle.z = self.config.up_m;
        self.sigma = Some(sigma);
        Ok(Pose { velocity, ..Pose::level(middle, self.heading.unwrap_or(0.0)) })
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.sigma
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), CarriedError> {
        self.goal = Some(*goal);
        let Some(guide) = &mut self.guide else { return Ok(()) };
        guide.show(goal, &self.frame, self.gnss.clock_s()).map_err(CarriedError::Guide)
    }

    /// It is on the ground; there is nowhere to go any more.
    fn land(&mut self) -> Result<(), CarriedError> {
        self.goal = None;
        if let Some(guide) = &mut self.guide {
            guide.sent = None;
        }
        self.dismissed = true;
        Ok(())
    }
}

/// The carrier turns the body; an order to turn does nothing.
impl<G: Positioning> Spinner for CarriedVehicle<G> {
    fn spin(&mut self, _rate: Option<f64>) -> Result<(), CarriedError> {
        Ok(())
    }
}

/// It takes part from its first place on until it is dismissed. It counts as in the air meanwhile:
/// nothing has to take off.
impl<G: Positioning> Aircraft for CarriedVehicle<G> {
    fn state(&mut self) -> Result<AircraftState, CarriedError> {
        let hindrance = self.pose().err().map_or(String::new(), |error| error.to_string());
        let takes_part = self.began && !self.dismissed;
        Ok(AircraftState {
            mode: if self.rooted { "FIXED" } else { "CARRIED" }.to_owned(),
            armed: takes_part,
            airborne: takes_part,
            commanded: takes_part && hindrance.is_empty(),
            hands: if takes_part { Hands::Ours } else { Hands::Nobody },
            rooted: self.rooted,
            hindrance,
            ..AircraftState::default()
        })
    }

    fn take_off(&mut self, _up_m: f64) -> Result<(), CarriedError> {
        Ok(())
    }

    fn take_over(&mut self) -> Result<(), CarriedError> {
        Ok(())
    }

    fn return_to_launch(&mut self) -> Result<(), CarriedError> {
        self.land()
    }

    fn device_failure(&mut self) -> Option<CarriedError> {
        self.gnss.failure().map(CarriedError::Gnss)
    }
}

/// A sentence WPL of NMEA 0183.
fn waypoint(place: &Geodetic) -> String {
    let lat = angle_field(place.lat_deg, 2, ['N', 'S']);
    let lon = angle_field(place.lon_deg, 3, ['E', 'W']);
    sentence(&format!("FXWPL,{lat},{lon},NEXT"))
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use std::{cell::RefCell, f64::consts::FRAC_PI_2, rc::Rc};

    use foxhunt_wire::memory_pair;

    use super::*;

    /// A receiver that reports the position and the time that the test sets.
    struct Reports(GnssPosition, f64);

    impl Positioning for Reports {
        fn position(&mut self) -> Result<GnssPosition, GnssError> {
            Ok(self.0)
        }

        fn clock_s(&self) -> Option<f64> {
            Some(self.1)
        }
    }

    /// A receiver with a compass that looks to the East.
    fn reports(east_m: f64, north_m: f64) -> Reports {
        Reports(GnssPosition { heading: Some(0.0), ..at(east_m, north_m) }, 0.0)
    }

    fn frame() -> LocalFrame {
        let origin = Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 0.0 };
        LocalFrame::new(origin).expect("on Earth")
    }

    fn at(east_m: f64, north_m: f64) -> GnssPosition {
        let place = frame().to_geodetic(&Vector3::new(east_m, north_m, 300.0));
        Mark::new(place, 2.0).position().expect("a mark")
    }

    #[test]
    fn the_nose_is_that_of_a_compass_or_the_course_or_stays() {
        let mut walker =
            CarriedVehicle::new(CarriedConfig::default(), reports(10.0, 20.0), frame())
                .with_antenna(Vector3::new(2.0, 0.0, 1.0));
        let mut pose = |velocity: [f64; 2], heading: Option<f64>| {
            let [east, north] = velocity;
            let velocity_mps = Some(Vector3::new(east, north, 0.3));
            walker.gnss().0 = GnssPosition { velocity_mps, heading, ..at(10.0, 20.0) };
            walker.pose().expect("a place")
        };
        // At a walk to the North: the antenna is 2 m in front, and the height is the carrier's.
        let walks = pose([0.0, 1.4], None);
        assert_abs_diff_eq!(walks.heading, FRAC_PI_2, epsilon = 1e-12);
        assert!((walks.position - Vector3::new(10.0, 18.0, 1.5)).norm() < 1e-3, "{walks:?}");
        assert_eq!(walks.velocity, Some(Vector3::new(0.0, 1.4, 0.0)));
        assert!((pose([-0.4, 0.0], None).heading - FRAC_PI_2).abs() < 1e-12, "it stands");
        assert!((pose([0.0, 1.4], Some(1.0)).heading - 1.0).abs() < 1e-12, "the compass");
        assert_eq!(walker.position_sigma(), Some(Vector3::new(2.0, 2.0, 0.5)));
        let config = CarriedConfig { heading_deg_compass: Some(90.0), ..CarriedConfig::default() };
        let mut kept = CarriedVehicle::new(config, reports(0.0, 0.0), frame());
        kept.gnss().0.heading = Some(2.0);
        assert_abs_diff_eq!(kept.pose().expect("a place").heading, 0.0, epsilon = 1e-12);
    }

    #[test]
    fn goals_are_kept_and_sent_once_to_the_guide() {
        let (near, mut far) = memory_pair();
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), reports(0.0, 0.0), frame())
            .with_guide(Box::new(near));
        let goal = Waypoint { position: Vector3::new(-30.0, 40.0, 1.5) };
        walker.go_to(&goal).expect("memory");
        walker.go_to(&goal).expect("memory");
        assert_eq!(walker.goal(), Some(goal));
        let mut bytes = [0; 200];
        let count = far.receive(&mut bytes).expect("memory");
        let text = str::from_utf8(&bytes[..count]).expect("text");
        // 40 m are 0.0216 minutes, and 30 m are 0.0251 at 50° North.
        assert_eq!(text, "$FXWPL,5000.0216,N,01359.9749,E,NEXT*48\r\n");
        let south_west = Geodetic { lat_deg: -0.5, lon_deg: -9.999_999_99, alt_m: 0.0 };
        assert!(waypoint(&south_west).starts_with("$FXWPL,0030.0000,S,01000.0000,W,NEXT*"));
    }

    #[test]
    fn a_heading_that_is_unknown_is_not_guessed() {
        let unknown = || Reports(at(10.0, 20.0), 0.0);
        let arm = Vector3::new(3.0, 4.0, 0.0);
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), unknown(), frame());
        assert!(matches!(walker.pose(), Err(CarriedError::NoHeading)));
        assert_eq!(walker.position_sigma(), None);
        let state = walker.state().expect("a state");
        assert!(!state.commanded && state.hindrance.contains("walk some metres"), "{state:?}");
        // After some metres it is the course, and stays.
        walker.gnss().0.velocity_mps = Some(Vector3::new(0.0, 1.4, 0.0));
        assert_abs_diff_eq!(walker.pose().expect("a course").heading, FRAC_PI_2, epsilon = 1e-12);
        walker.gnss().0.velocity_mps = Some(Vector3::zeros());
        assert_abs_diff_eq!(walker.pose().expect("the last").heading, FRAC_PI_2, epsilon = 1e-12);
        // An antenna without a direction goes on, with the arm of the GNSS as a part of σ.
        let mut omni = CarriedVehicle::new(CarriedConfig::default(), unknown(), frame())
            .with_antenna(arm)
            .omnidirectional();
        let pose = omni.pose().expect("a place");
        assert!((pose.position - Vector3::new(10.0, 20.0, 1.5)).norm() < 1e-3, "{pose:?}");
        let sigma = omni.position_sigma().expect("with the place");
        assert_abs_diff_eq!(sigma.x, (4.0 + 12.5_f64).sqrt(), epsilon = 1e-12);
        omni.set_heading(0.0);
        let pose = omni.pose().expect("a place");
        assert!((pose.position - Vector3::new(7.0, 16.0, 1.5)).norm() < 1e-3, "{pose:?}");
        assert_eq!(omni.position_sigma(), Some(Vector3::new(2.0, 2.0, 0.5)));
    }

    #[test]
    fn a_height_that_is_unknown_is_no_matter_on_the_ground() {
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), reports(1.0, 2.0), frame());
        walker.gnss().0.height = HeightOrigin::SeaLevel;
        let position = walker.pose().expect("a place").position;
        assert_abs_diff_eq!(position.z, 1.5, epsilon = 1e-12);
    }

    /// A guide that fails where the test orders it, and may be opened again.
    #[derive(Clone, Default)]
    struct Flaky(Rc<RefCell<(bool, u32, Vec<String>)>>);

    impl ByteStream for Flaky {
        fn receive(&mut self, _into: &mut [u8]) -> io::Result<usize> {
            Ok(0)
        }

        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            let mut guide = self.0.borrow_mut();
            if guide.0 {
                return Err(io::ErrorKind::NotConnected.into());
            }
            guide.2.push(String::from_utf8_lossy(bytes).into_owned());
            Ok(())
        }

        fn connections(&self) -> u32 {
            self.0.borrow().1
        }
    }

    #[test]
    fn a_goal_that_failed_or_may_be_lost_is_sent_again() {
        let guide = Flaky::default();
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), reports(0.0, 0.0), frame())
            .with_guide(Box::new(guide.clone()));
        let goal = Waypoint { position: Vector3::new(-30.0, 40.0, 1.5) };
        let sent = || guide.0.borrow().2.len();
        guide.0.borrow_mut().0 = true;
        assert!(matches!(walker.go_to(&goal), Err(CarriedError::Guide(_))));
        assert!(walker.pose().is_ok(), "the place does not depend on the guide");
        guide.0.borrow_mut().0 = false;
        walker.go_to(&goal).expect("the guide is there again");
        assert_eq!(sent(), 1, "it was not taken for sent");
        // A goal that failed is sent without another order, too.
        let other = Waypoint { position: Vector3::new(5.0, 0.0, 1.5) };
        guide.0.borrow_mut().0 = true;
        assert!(walker.go_to(&other).is_err());
        guide.0.borrow_mut().0 = false;
        let _ = walker.pose().expect("a place");
        assert_eq!(sent(), 2);
        // It is repeated by the clock, and on a new connection.
        for (time_s, connections, expected) in
            [(4.9, 0, 2), (5.1, 0, 3), (9.9, 0, 3), (10.0, 1, 4), (10.1, 1, 4)]
        {
            walker.gnss().1 = time_s;
            guide.0.borrow_mut().1 = connections;
            let _ = walker.pose().expect("a place");
            assert_eq!(sent(), expected, "at {time_s} s");
        }
        let all = guide.0.borrow().2.clone();
        assert!(all[1..].iter().all(|text| text == &all[1]) && all[0] != all[1], "{all:?}");
        walker.land().expect("it is on the ground");
        walker.gnss().1 = 100.0;
        let _ = walker.pose().expect("a place");
        assert_eq!(sent(), 4, "nowhere to go");
    }

    #[test]
    fn it_takes_part_until_it_is_dismissed() {
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), reports(0.0, 0.0), frame());
        let state = walker.state().expect("a state");
        assert!(state.commanded && state.airborne && !state.rooted);
        assert_eq!((state.mode.as_str(), state.hands), ("CARRIED", Hands::Ours));
        walker.return_to_launch().expect("on the ground");
        let state = walker.state().expect("a state");
        assert!(!state.commanded && !state.airborne && !state.armed);
        let config = FixedConfig { sigma_m: 0.2, ..FixedConfig::default() };
        let mut station = CarriedVehicle::fixed(config, [5.0, -7.0], frame());
        let pose = station.pose().expect("a mark");
        assert!((pose.position - Vector3::new(5.0, -7.0, 3.0)).norm() < 1e-3, "{pose:?}");
        assert!(abs_diff_eq!(pose.heading, FRAC_PI_2, epsilon = 1e-12), "North");
        assert_eq!(station.position_sigma(), Some(Vector3::repeat(0.2)));
        assert!(station.state().expect("a state").rooted);
    }

    #[test]
    fn a_carrier_without_a_place_takes_no_part() {
        struct Lost;
        impl Positioning for Lost {
            fn position(&mut self) -> Result<GnssPosition, GnssError> {
                Err(GnssError::NoFix { satellites: Some(2), missing: None })
            }
        }
        let mut walker = CarriedVehicle::new(CarriedConfig::default(), Lost, frame());
        let state = walker.state().expect("a state");
        assert!(!state.commanded && !state.airborne);
        assert!(state.hindrance.contains("uses 2 satellites"), "{}", state.hindrance);
        let config = CarriedConfig { speed_mps: 0.0, ..CarriedConfig::default() };
        assert_eq!(config.check().expect_err("0").to_string().split(' ').next(), Some("speed_mps"));
        let config = FixedConfig { sigma_m: -1.0, ..FixedConfig::default() };
        assert!(config.check().expect_err("negative").to_string().starts_with("sigma_m is -1"));
    }
}
