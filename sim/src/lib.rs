//! A simulated world behind the same traits as the hardware.
//!
//! A [`World`] holds what is true: beacons, drones, time, and a radio channel between them. The
//! devices of a drone are handles to it that implement the traits of [`foxhunt_core`], so that a
//! source or a hunt made of them does not know that it is simulated. Nothing moves by itself:
//! [`World::advance`] lets time pass.
//!
//! ```
//! use foxhunt_core::{BeaconId, PatternSource};
//! use foxhunt_sensors::StepperConfig;
//! use foxhunt_sim::{BeaconConfig, DroneConfig, World, WorldConfig};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = WorldConfig {
//!     beacons: vec![BeaconConfig { name: "fox".into(), east_m: 20.0, north_m: 5.0,
//! ..Default::default() }],
//!     drones: vec![DroneConfig { up_m: 4.0, ..DroneConfig::default() }],
//!     ..WorldConfig::default()
//! };
//! let world = World::new(&config, 1)?;
//! let mut source = world.stepper(0, StepperConfig::pritzl2018())?;
//! source.begin(&[BeaconId(0)])?;
//! let samples = loop {
//!     world.advance(0.01)?;
//!     if let Some(sweep) = source.poll()? {
//!         break sweep.samples.len();
//!     }
//! };
//! assert_eq!(samples, 128 * 6);
//! # Ok(())
//! # }
//! ```

mod config;
mod devices;
#[cfg(feature = "emulators")]
mod emulate;
mod error;
mod quadrotor;
mod truth;

pub use config::{
    BeaconConfig, BeaconCourse, ChannelConfig, DeadZoneConfig, DipoleConfig, DroneConfig, Interval,
    KinematicConfig, OtherConfig, PathLossConfig, PulseTrain, RangeDifferenceConfig,
    ReflectorConfig, ReliefConfig, ScatteringConfig, ShadowingConfig, SimStepperConfig,
    ThreeAxisConfig, TwoRayConfig, VehicleConfig, WorldConfig,
};
pub use devices::{
    LateSource, SimBody, SimClock, SimInstrument, SimOmnidirectional, SimRadio, SimRotator,
    SimStepper, SimVehicle, World,
};
#[cfg(feature = "emulators")]
pub use emulate::{
    AutopilotConfig, AutopilotFaults, CableFaults, Cabled, EmulatedArDrone, EmulatedAutopilot,
    EmulatedCarrier, EmulatedCaster, EmulatedCasterConfig, EmulatedDongle, EmulatedGnss,
    EmulatedGnssConfig, EmulatedGnssKind, EmulatedKraken, EmulatedKrakenConfig,
    EmulatedMotionCapture, EmulatedMotionCaptureConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig,
    EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch, EmulatedXbee, EmulatedXbeeConfig,
    Emulator, FailsafeOrder, GpsStep, InterfererConfig, PilotOrder, PlayedPulse, Port,
    xbee_address,
};
pub use error::{ReliefError, SimError};
pub use quadrotor::{Dynamics, Gains, Piloting, Quadrotor, QuadrotorConfig, WindConfig};

/// Speed of light in metres per second.
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// Returns true if a switch that is off by default was left off.
fn is_false(switch: &bool) -> bool {
    !switch
}
