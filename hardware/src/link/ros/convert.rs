//! Messages of a link and what they are in ROS, and a hunt in messages that every viewer knows.

use foxhunt_core::{
    BeaconId, Bearing, BearingMode, BearingModes, Estimate, Level, Measured, MeasuredList, Pose,
    Quantity, QuantityName, Reception, Waypoint,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{
    DiagnosticArray, DiagnosticStatus, KeyValue, Path, PoseStamped, PoseWithCovariance,
    PoseWithCovarianceStamped, RosHeader,
};
use crate::link::{
    ClockOffset, Delivery, DroneView, Echo, Health, Leave, LinkError, Order, Report, Stage, Status,
    Taken, Turn, UnixTime, ros,
};

/// The variance of what is not estimated: height and attitude.
const UNKNOWN: f64 = 1e6;

fn point(place: &Vector3<f64>) -> ros::Point {
    ros::Point { x: place.x, y: place.y, z: place.z }
}

fn place(point: &ros::Point) -> Vector3<f64> {
    Vector3::new(point.x, point.y, point.z)
}

/// A pose as ROS has it: a nose that is up is a negative turn about the axis to the left.
fn ros_pose(pose: &Pose) -> ros::Pose {
    let turn = UnitQuaternion::from_euler_angles(pose.roll, -pose.pitch, pose.heading);
    let orientation = ros::Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w };
    ros::Pose { position: point(&pose.position), orientation }
}

fn pose(ros: &ros::Pose) -> Pose {
    let ros::Quaternion { x, y, z, w } = ros.orientation;
    // All zeros is what is sent by those who do not know their attitude.
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).unwrap_or_default();
    let (roll, pitch, heading) = turn.euler_angles();
    Pose { position: place(&ros.position), heading, pitch: -pitch, roll, velocity: None }
}

pub(super) fn pose_message<H: RosHeader>(
    at: UnixTime,
    pose: &Pose,
) -> Result<ros::PoseStamped<H>, LinkError> {
    Ok(ros::PoseStamped { header: H::at(at)?, pose: ros_pose(pose) })
}

pub(super) fn report_of_pose<H: RosHeader>(message: &ros::PoseStamped<H>) -> Report {
    Report::Pose { at: message.header.moment(), pose: pose(&message.pose) }
}

pub(super) fn status_message<H: RosHeader>(status: &Status) -> Result<ros::Status<H>, LinkError> {
    let Status { at, sent, clock, order, stage, failure } = status;
    let stage = Stage::ALL.iter().zip(0..).find(|(one, _)| *one == stage);
    let clock =
        clock.map(|clock| vec![clock.offset_s, clock.uncertainty_s, f64::from(clock.jumps)]);
    Ok(ros::Status {
        header: H::at(*at)?,
        order: *order,
        failure: failure.clone(),
        stage: stage.map_or(u8::MAX, |(_, number)| number),
        sent_sec: sent.sec,
        sent_nanosec: sent.nanosec,
        clock: clock.unwrap_or_default(),
    })
}

/// The status of a message; a stage that is not known takes no orders.
pub(super) fn report_of_status<H: RosHeader>(message: ros::Status<H>) -> Report {
    let ros::Status { header, order, failure, stage, sent_sec, sent_nanosec, clock } = message;
    let clock = match *clock {
        [offset_s, uncertainty_s, jumps] if offset_s.is_finite() && uncertainty_s.is_finite() => {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number, and those out of range are the nearest in it"
            )]
            let jumps = jumps as u32;
            Some(ClockOffset { offset_s, uncertainty_s, jumps })
        }
        _ => None,
    };
    Report::Status(Status {
        at: header.moment(),
        sent: UnixTime { sec: sent_sec, nanosec: sent_nanosec },
        clock,
        order,
        stage: Stage::ALL.get(usize::from(stage)).copied().unwrap_or(Stage::Away),
        failure,
    })
}

pub(super) fn reception_message<H: RosHeader>(
    delivery: &Delivery,
) -> Result<ros::Reception<H>, LinkError> {
    let header = H::at(delivery.ended)?;
    let beacon = delivery.beacon.0;
    let reception = match &delivery.reception {
        Ok(reception) => reception,
        Err(reason) => {
            let reason = reason.clone();
            return Ok(ros::Reception { header, beacon, reason, ..ros::Reception::default() });
        }
    };
    let bearing = reception.bearing.unwrap_or(Bearing { angle: 0.0, sigma: 0.0, confidence: 0.0 });
    let level = reception.level.unwrap_or(Level { rss_dbm: f64::NAN, sigma_db: 0.0 });
    let modes = |of: fn(&BearingMode) -> f64| reception.modes.as_slice().iter().map(of).collect();
    let measured = |of: fn(&Measured) -> f64| reception.measured.iter().map(of).collect();
    Ok(ros::Reception {
        header,
        beacon,
        heard: true,
        reason: String::new(),
        position: point(&reception.receiver.position),
        heading: reception.receiver.heading,
        pitch: reception.receiver.pitch,
        roll: reception.receiver.roll,
        position_sigma: reception.receiver_sigma_m.iter().flatten().copied().collect(),
        rss_dbm: level.rss_dbm,
        rss_sigma_db: level.sigma_db,
        has_bearing: reception.bearing.is_some(),
        bearing: bearing.angle,
        bearing_sigma: bearing.sigma,
        bearing_confidence: bearing.confidence,
        covariance: reception.covariance,
        mode_weights: modes(|mode| mode.weight),
        mode_bearings: modes(|mode| mode.angle),
        mode_sigmas: modes(|mode| mode.sigma),
        velocity: reception.receiver.velocity.iter().flatten().copied().collect(),
        quantity_names: reception.measured.iter().map(|value| value.name.to_string()).collect(),
        quantity_values: measured(|value| value.value),
        quantity_sigmas: measured(|value| value.sigma),
    })
}

/// Returns the delivery of a message; one without a reception carries the reason.
pub(super) fn delivery<H: RosHeader>(message: ros::Reception<H>) -> Delivery {
    let beacon = BeaconId(message.beacon);
    let ended = message.header.moment();
    let reception = if message.heard { reception(&message) } else { Err(message.reason) };
    Delivery { beacon, ended, reception }
}

fn reception<H>(message: &ros::Reception<H>) -> Result<Reception, String> {
    let ros::Reception { mode_weights, mode_bearings, mode_sigmas, .. } = message;
    let competing = mode_weights.len();
    if mode_bearings.len() != competing || mode_sigmas.len() != competing {
        return Err(format!(
            "{competing} mode_weights, {} mode_bearings and {} mode_sigmas",
            mode_bearings.len(),
            mode_sigmas.len()
        ));
    }
    let modes = mode_weights.iter().zip(mode_bearings).zip(mode_sigmas);
    let modes: Vec<BearingMode> =
        modes.map(|((&weight, &angle), &sigma)| BearingMode { weight, angle, sigma }).collect();
    let bearing = Bearing {
        angle: message.bearing,
        sigma: message.bearing_sigma,
        confidence: message.bearing_confidence,
    };
    Ok(Reception {
        beacon: BeaconId(message.beacon),
        // Seconds of whoever reads it: see `Delivery`.
        time: 0.0,
        receiver: Pose {
            position: place(&message.position),
            heading: message.heading,
            pitch: message.pitch,
            roll: message.roll,
            velocity: three("velocity", &message.velocity)?,
        },
        level: (!message.rss_dbm.is_nan())
            .then_some(Level { rss_dbm: message.rss_dbm, sigma_db: message.rss_sigma_db }),
        // Drones deliver what they received; levels at a limit come from recordings.
        silence: None,
        saturation: None,
        bearing: message.has_bearing.then_some(bearing),
        covariance: message.covariance,
        modes: BearingModes::new(&modes).map_err(|error| error.to_string())?,
        receiver_sigma_m: three("position_sigma", &message.position_sigma)?,
        measured: measured(message)?,
    })
}

/// East, North and Up, or nothing.
fn three(field: &str, numbers: &[f64]) -> Result<Option<Vector3<f64>>, String> {
    match *numbers {
        [] => Ok(None),
        [east, north, up] => Ok(Some(Vector3::new(east, north, up))),
        _ => Err(format!("{field} has {} numbers, not 3", numbers.len())),
    }
}

/// Returns the quantities that were measured besides level and bearing.
fn measured<H>(message: &ros::Reception<H>) -> Result<MeasuredList, String> {
    let ros::Reception { quantity_names, quantity_values, quantity_sigmas, .. } = message;
    let count = quantity_names.len();
    if quantity_values.len() != count || quantity_sigmas.len() != count {
        return Err(format!(
            "{count} quantity_names, {} quantity_values and {} quantity_sigmas",
            quantity_values.len(),
            quantity_sigmas.len()
        ));
    }
    let values = quantity_names.iter().zip(quantity_values).zip(quantity_sigmas);
    let values = values.map(|((name, &value), &sigma)| {
        let name = QuantityName::new(name).map_err(|error| error.to_string())?;
        // Values of every quantity have the same limits.
        let checked = Measured::new(Quantity::RANGE, value, sigma)
            .map_err(|_| format!("{name} is {value} with a σ of {sigma}"))?;
        Ok(Measured { name, ..checked })
    });
    let values = values.collect::<Result<Vec<_>, String>>()?;
    MeasuredList::new(&values).map_err(|error| error.to_string())
}

pub(super) fn order_message<H: RosHeader>(order: &Order) -> Result<ros::Order<H>, LinkError> {
    let echo = || order.echo.iter().flat_map(|echo| [echo.sent, echo.received]);
    Ok(ros::Order {
        header: H::at(order.at)?,
        number: order.number,
        has_goal: order.goal.is_some(),
        goal: order.goal.map_or_else(ros::Point::default, |goal| point(&goal.position)),
        land: order.land,
        turn: order.turn.number,
        beacons: order.turn.beacons.iter().map(|beacon| beacon.0).collect(),
        taken_beacons: order.taken.iter().map(|taken| taken.beacon.0).collect(),
        taken_sec: order.taken.iter().map(|taken| taken.ended.sec).collect(),
        taken_nanosec: order.taken.iter().map(|taken| taken.ended.nanosec).collect(),
        take_off: order.take_off,
        leave: match order.leave {
            Leave::Not => 0,
            Leave::AtEnd => 1,
            Leave::OnAbort => 2,
        },
        echo_sec: echo().map(|at| at.sec).collect(),
        echo_nanosec: echo().map(|at| at.nanosec).collect(),
    })
}

/// Returns the order of a message; a goal that is not finite is dropped, and half a delivery is
/// left out.
pub(super) fn order<H: RosHeader>(message: &ros::Order<H>) -> Order {
    let position = place(&message.goal);
    let is_place = message.has_goal && position.iter().all(|metres| metres.is_finite());
    let times = message.taken_sec.iter().zip(&message.taken_nanosec);
    let taken = message.taken_beacons.iter().zip(times).map(|(&beacon, (&sec, &nanosec))| Taken {
        beacon: BeaconId(beacon),
        ended: UnixTime { sec, nanosec },
    });
    let echo = match (&*message.echo_sec, &*message.echo_nanosec) {
        (&[sent_s, received_s], &[sent_ns, received_ns]) => Some(Echo {
            sent: UnixTime { sec: sent_s, nanosec: sent_ns },
            received: UnixTime { sec: received_s, nanosec: received_ns },
        }),
        _ => None,
    };
    Order {
        at: message.header.moment(),
        number: message.number,
        goal: is_place.then_some(Waypoint { position }),
        land: message.land,
        turn: Turn {
            number: message.turn,
            beacons: message.beacons.iter().copied().map(BeaconId).collect(),
        },
        taken: taken.collect(),
        take_off: message.take_off,
        leave: match message.leave {
            0 => Leave::Not,
            1 => Leave::AtEnd,
            // An order of a later version is no reason to go on.
            _ => Leave::OnAbort,
        },
        echo,
    }
}

/// Returns the belief about a beacon's place. Its height and attitude are not known.
pub(super) fn estimate_message<H: RosHeader>(
    at: UnixTime,
    estimate: &Estimate<2>,
) -> Result<PoseWithCovarianceStamped<H>, LinkError> {
    let at_mean = foxhunt_core::Pose::at(estimate.mean.x, estimate.mean.y, 0.0);
    let mut covariance = [[0.0; 6]; 6];
    for (row, cells) in covariance.iter_mut().enumerate() {
        cells[row] = UNKNOWN;
    }
    for (row, cells) in covariance.iter_mut().take(2).enumerate() {
        for (column, cell) in cells.iter_mut().take(2).enumerate() {
            *cell = estimate.covariance[(row, column)];
        }
    }
    let pose = PoseWithCovariance { pose: ros_pose(&at_mean), covariance };
    Ok(PoseWithCovarianceStamped { header: H::at(at)?, pose })
}

/// Returns the ordered place of a drone.
pub(super) fn goal_message<H: RosHeader>(
    at: UnixTime,
    goal: &Waypoint,
) -> Result<PoseStamped<H>, LinkError> {
    pose_message(at, &foxhunt_core::Pose::level(goal.position, 0.0))
}

/// Returns the past path of a drone.
pub(super) fn path_message<H: RosHeader>(
    at: UnixTime,
    drone: &DroneView,
) -> Result<Path<H>, LinkError> {
    let poses = drone.path.iter().map(|(at, pose)| {
        let pose = ros_pose(pose);
        Ok(PoseStamped { header: H::at(*at)?, pose })
    });
    Ok(Path { header: H::at(at)?, poses: poses.collect::<Result<_, LinkError>>()? })
}

/// Returns the health of the drones and of the hunt.
pub(super) fn diagnostics_message<H: RosHeader>(
    at: UnixTime,
    health: &[Health],
) -> Result<DiagnosticArray<H>, LinkError> {
    let status = health.iter().map(|health| DiagnosticStatus {
        level: u8::from(health.trouble.is_some()),
        name: health.name.clone(),
        message: health.trouble.as_ref().unwrap_or(&health.doing).clone(),
        hardware_id: "foxhunt".to_owned(),
        values: health
            .values
            .iter()
            .map(|(key, value)| KeyValue { key: key.clone(), value: value.clone() })
            .collect(),
    });
    Ok(DiagnosticArray { header: H::at(at)?, status: status.collect() })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde::{Deserialize, Serialize};

    use super::*;

    /// A header that holds every time.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    struct Stamp(i64, u32);

    impl RosHeader for Stamp {
        fn at(moment: UnixTime) -> Result<Self, LinkError> {
            Ok(Self(moment.sec, moment.nanosec))
        }

        fn moment(&self) -> UnixTime {
            UnixTime { sec: self.0, nanosec: self.1 }
        }
    }

    fn number() -> impl Strategy<Value = f64> {
        -1e4..1e4
    }

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        [number(), number(), number()].prop_map(Vector3::from)
    }

    fn moment() -> impl Strategy<Value = UnixTime> {
        (0_i64..4_000_000_000, 0_u32..1_000_000_000)
            .prop_map(|(sec, nanosec)| UnixTime { sec, nanosec })
    }

    fn attitude() -> impl Strategy<Value = Pose> {
        (vector(), -3.1..3.1, -1.5..1.5, -3.1..3.1).prop_map(|(position, heading, pitch, roll)| {
            Pose { position, heading, pitch, roll, velocity: None }
        })
    }

    fn bearing() -> impl Strategy<Value = Option<Bearing>> {
        let bearing = (number(), number(), 0.0..1.0)
            .prop_map(|(angle, sigma, confidence)| Bearing { angle, sigma, confidence });
        proptest::option::of(bearing)
    }

    fn level() -> impl Strategy<Value = Option<Level>> {
        let level =
            (number(), number()).prop_map(|(rss_dbm, sigma_db)| Level { rss_dbm, sigma_db });
        proptest::option::of(level)
    }

    fn measured_list() -> impl Strategy<Value = MeasuredList> {
        let value = ("[a-z]{1,31}", number(), 0.1..1e3).prop_map(|(name, value, sigma)| Measured {
            name: QuantityName::new(&name).expect("short"),
            value,
            sigma,
        });
        proptest::collection::vec(value, 0..=MeasuredList::CAPACITY)
            .prop_map(|values| MeasuredList::new(&values).expect("there is room"))
    }

    /// Two directions, whose weights are exact.
    fn modes() -> impl Strategy<Value = BearingModes> {
        let two = [(number(), 0.1..2.0), (number(), 0.1..2.0)].prop_map(|two| {
            let modes = two.map(|(angle, sigma)| BearingMode { weight: 0.5, angle, sigma });
            BearingModes::new(&modes).expect("in range")
        });
        proptest::option::of(two).prop_map(Option::unwrap_or_default)
    }

    proptest! {
        #[test]
        fn a_reception_comes_as_it_was_sent(
            (ended, receiver, sigma) in (moment(), attitude(), proptest::option::of(vector())),
            (level, covariance) in (level(), number()),
            (bearing, modes, beacon) in (bearing(), modes(), any::<u16>()),
            (velocity, measured) in (proptest::option::of(vector()), measured_list()),
        ) {
            let beacon = BeaconId(beacon);
            let reception = Reception {
                beacon, time: 0.0, receiver: Pose { velocity, ..receiver }, silence: None,
                saturation: None,
                level, bearing,
                covariance, modes, receiver_sigma_m: sigma, measured,
            };
            let sent = Delivery { beacon, ended, reception: Ok(reception) };
            let message = reception_message::<Stamp>(&sent)?;
            prop_assert_eq!(delivery(message), sent);
        }

        #[test]
        fn a_status_comes_as_it_was_sent(
            (at, sent, order) in (moment(), moment(), any::<u64>()),
            (offset_s, uncertainty_s, jumps) in (number(), number(), any::<u32>()),
            (known, stage, failure) in (any::<bool>(), 0_usize..7, ".{0,9}"),
        ) {
            let clock = known.then_some(ClockOffset { offset_s, uncertainty_s, jumps });
            let status = Status { at, sent, clock, order, stage: Stage::ALL[stage], failure };
            let message = status_message::<Stamp>(&status)?;
            prop_assert_eq!(report_of_status(message), Report::Status(status));
        }

        #[test]
        fn an_order_comes_as_it_was_sent(
            (at, goal, land) in (moment(), proptest::option::of(vector()), any::<bool>()),
            (take_off, leave) in (any::<bool>(), 0_usize..3),
            echo in proptest::option::of((moment(), moment())),
            (number, turn, beacons) in (
                any::<u64>(), any::<u64>(), proptest::collection::vec(any::<u16>(), 0..9)),
            taken in proptest::collection::vec((any::<u16>(), moment()), 0..9),
        ) {
            let sent = Order {
                at,
                number,
                goal: goal.map(|position| Waypoint { position }),
                land,
                turn: Turn { number: turn, beacons: beacons.into_iter().map(BeaconId).collect() },
                taken: taken
                    .into_iter()
                    .map(|(beacon, ended)| Taken { beacon: BeaconId(beacon), ended })
                    .collect(),
                take_off,
                leave: [Leave::Not, Leave::AtEnd, Leave::OnAbort][leave],
                echo: echo.map(|(sent, received)| Echo { sent, received }),
            };
            prop_assert_eq!(order(&order_message::<Stamp>(&sent)?), sent);
        }

        /// A quaternion turns the axes of the body as core's angles do.
        #[test]
        fn a_pose_keeps_its_axes(at in moment(), body in attitude()) {
            let message = pose_message::<Stamp>(at, &body)?;
            let ros::Quaternion { x, y, z, w } = message.pose.orientation;
            let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
            let Report::Pose { at: when, pose } = report_of_pose(&message) else {
                panic!("no pose")
            };
            prop_assert_eq!((when, pose.position), (at, body.position));
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                prop_assert!((body.to_body(&(turn * axis)) - axis).norm() < 1e-9);
                prop_assert!((pose.to_body(&(turn * axis)) - axis).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn what_is_no_reception_names_the_reason() {
        let nothing = Delivery {
            beacon: BeaconId(3),
            ended: UnixTime::whole(5),
            reception: Err("too weak".to_owned()),
        };
        let message = reception_message::<Stamp>(&nothing).expect("any time");
        assert_eq!(delivery(message), nothing);
        for (message, why) in [
            (ros::Reception { position_sigma: vec![1.0], ..empty() }, "position_sigma has 1"),
            (ros::Reception { velocity: vec![1.0], ..empty() }, "velocity has 1"),
            (ros::Reception { quantity_values: vec![1.0], ..empty() }, "0 quantity_names, 1"),
            (quantity("", 1.0), "has 0 bytes"),
            (quantity("range_m", f64::NAN), "range_m is NaN"),
            (ros::Reception { mode_weights: vec![1.0], ..empty() }, "1 mode_weights, 0"),
            (
                ros::Reception {
                    mode_weights: vec![0.5, f64::NAN],
                    mode_bearings: vec![0.0; 2],
                    mode_sigmas: vec![1.0; 2],
                    ..empty()
                },
                "NaN",
            ),
        ] {
            let reason = delivery(message).reception.expect_err("it is none");
            assert!(reason.contains(why), "{reason}");
        }
        // Nobody knows its attitude.
        let zeros = ros::PoseStamped { header: Stamp::default(), pose: ros::Pose::default() };
        let level = Report::Pose { at: UnixTime::default(), pose: Pose::default() };
        assert_eq!(report_of_pose(&zeros), level);
        let nowhere = ros::Point { x: f64::NAN, ..ros::Point::default() };
        let message = ros::Order::<Stamp> { has_goal: true, goal: nowhere, ..Default::default() };
        assert_eq!(order(&message).goal, None);
    }

    fn quantity(name: &str, value: f64) -> ros::Reception<Stamp> {
        ros::Reception {
            quantity_names: vec![name.to_owned()],
            quantity_values: vec![value],
            quantity_sigmas: vec![1.0],
            ..empty()
        }
    }

    fn empty() -> ros::Reception<Stamp> {
        ros::Reception { heard: true, ..ros::Reception::default() }
    }
}
