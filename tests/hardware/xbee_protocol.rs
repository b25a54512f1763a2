//! The one-question rule of the XBee driver, with a radio whose every word is written here.

use std::{cell::Cell, rc::Rc};

use foxhunt::{
    core::{BeaconId, Radio},
    hardware::{XbeeConfig, XbeeError, XbeeQuestion, XbeeRadio},
    wire::{
        ByteStream, MemoryStream, memory_pair,
        xbee::{
            Address16, Address64, ApiMode, AtCommand, AtStatus, Decoder, DeliveryStatus, Frame,
            TransmitStatus,
        },
    },
};

const BEACON: Address64 = Address64(0x0013_A200_40AA_BBCC);
const OTHER: Address64 = Address64(0x0013_A200_40AA_BBCD);

type Time = Rc<Cell<f64>>;

/// The radio's side, and the driver.
struct Script<C> {
    time: Time,
    line: MemoryStream,
    decoder: Decoder,
    driver: XbeeRadio<MemoryStream, C>,
}

fn script(firmware: [u8; 2], question: XbeeQuestion, echoed: bool) -> Script<impl Fn() -> f64> {
    let time = Time::default();
    let (line, host) = memory_pair();
    let beacons = [BEACON, OTHER].map(foxhunt::wire::xbee::Address::Long).to_vec();
    let config = XbeeConfig { beacons, question, echoed, ..XbeeConfig::default() };
    let clock = Rc::clone(&time);
    let driver = XbeeRadio::new(config, host, move || clock.get()).expect("it is in order");
    let mut script = Script { time, line, decoder: Decoder::new(ApiMode::Plain), driver };
    for _ in 0..5 {
        assert_eq!(script.poll(), None);
        let output = script.output();
        let [Frame::AtCommand { id, command, .. }] = output[..] else { panic!("{output:?}") };
        let value = match &command.0 {
            b"AP" => vec![1],
            b"VR" => firmware.to_vec(),
            b"HV" => vec![0x2E, 0x47],
            _ => vec![0, 0, 0, 1],
        };
        script.report(&Frame::AtResponse { id, command, status: AtStatus::OK, value });
    }
    assert_eq!(script.poll(), None);
    assert!(script.driver.identity().is_some());
    script
}

impl<C: Fn() -> f64> Script<C> {
    fn output(&mut self) -> Vec<Frame> {
        let mut bytes = [0; 512];
        let count = self.line.receive(&mut bytes).expect("it is in memory");
        self.decoder.push(&bytes[..count]).into_iter().flatten().collect()
    }

    fn report(&mut self, frame: &Frame) {
        self.line.send(&frame.encode(ApiMode::Plain).expect("short")).expect("it is in memory");
    }

    fn poll(&mut self) -> Option<f64> {
        self.driver.poll().unwrap_or_else(|error| panic!("{error}"))
    }

    /// Sends a question; the number and the payload of the packet that went out.
    fn query(&mut self) -> (u8, Vec<u8>) {
        self.driver.request(BeaconId(0)).expect("it is set up");
        self.sent()
    }

    fn sent(&mut self) -> (u8, Vec<u8>) {
        match self.output().pop() {
            Some(Frame::Transmit { id, to64: BEACON, data, .. }) => (id, data),
            Some(Frame::Transmit64 { id, to: BEACON, data, .. }) => (id, data),
            other => panic!("{other:?}"),
        }
    }

    /// A packet with these data comes from a radio.
    fn packet(&mut self, from64: Address64, data: &[u8]) {
        let data = data.to_vec();
        self.report(&Frame::Receive { from64, from16: Address16::UNKNOWN, options: 1, data });
    }

    /// The radio is queried for the last packet's power, and reports this.
    fn db(&mut self, level: u8) {
        match self.output().pop() {
            Some(Frame::AtCommand { id, command: AtCommand::DB, .. }) => {
                let command = AtCommand::DB;
                let status = AtStatus::OK;
                let value = vec![level];
                self.report(&Frame::AtResponse { id, command, status, value });
            }
            other => panic!("{other:?}"),
        }
    }

    fn wait(&self, seconds: f64) {
        self.time.set(self.time.get() + seconds);
    }
}

const ZIGBEE: [u8; 2] = [0x40, 0x60];
const PLAIN: [u8; 2] = [0x20, 0x03];

#[test]
fn only_the_beacons_own_answer_is_taken() {
    let mut script = script(ZIGBEE, XbeeQuestion::Auto, true);
    let (_, data) = script.query();
    script.packet(OTHER, &data);
    assert_eq!(script.poll(), None);
    assert!(script.output().is_empty(), "another's power is not requested");
    script.packet(BEACON, b"something else");
    assert_eq!(script.poll(), None);
    assert!(script.output().is_empty());
    script.packet(BEACON, &data);
    assert_eq!(script.poll(), None);
    script.db(61);
    assert_eq!(script.poll(), Some(-61.0));
    assert_eq!(script.poll(), None, "once");
    assert_eq!(script.driver.counts().foreign, 2);
}

#[test]
fn a_power_that_may_be_anothers_is_dropped_and_requested_again() {
    let mut script = script(ZIGBEE, XbeeQuestion::Auto, true);
    let (_, first) = script.query();
    script.packet(BEACON, &first);
    assert_eq!(script.poll(), None);
    // It comes between the answer and the power.
    script.packet(OTHER, b"hello");
    script.db(30);
    assert_eq!(script.poll(), None);
    let (_, second) = script.sent();
    assert_ne!(first, second);
    script.packet(BEACON, &second);
    assert_eq!(script.poll(), None);
    script.db(62);
    assert_eq!(script.poll(), Some(-62.0));
    assert_eq!(script.driver.counts().crossed, 1);
}

#[test]
fn a_late_answer_is_never_reported() {
    for question in [XbeeQuestion::Auto, XbeeQuestion::TransmitDb] {
        let mut script = script(ZIGBEE, question, true);
        let (_, first) = script.query();
        let (_, second) = script.query();
        script.packet(BEACON, &first);
        assert_eq!(script.poll(), None);
        assert!(script.output().is_empty());
        // The power of an older question comes when a newer one is out.
        script.packet(BEACON, &second);
        assert_eq!(script.poll(), None);
        let requested = script.output();
        let [Frame::AtCommand { id, command, .. }] = requested[..] else { panic!("{requested:?}") };
        script.query();
        let status = AtStatus::OK;
        let value = vec![40];
        script.report(&Frame::AtResponse { id, command, status, value });
        assert_eq!(script.poll(), None);
        // Time passes, and the question with it.
        script.wait(0.5);
        assert_eq!(script.poll(), None);
        assert_eq!(script.driver.counts().silent, 1);
    }
}

#[test]
fn without_an_echo_a_beacon_has_its_time_to_be_late() {
    let mut script = script(PLAIN, XbeeQuestion::Auto, false);
    let receive = |level| Frame::Receive64 {
        from: BEACON,
        rssi_neg_dbm: level,
        options: 0,
        data: b"ANS".to_vec(),
    };
    script.query();
    script.wait(0.1);
    script.driver.request(BeaconId(0)).expect("it is set up");
    assert!(script.output().is_empty(), "the older question's answer may come yet");
    script.report(&receive(70));
    assert_eq!(script.poll(), None);
    // The other beacon's answers cannot be taken for it.
    script.driver.request(BeaconId(1)).expect("it is set up");
    assert!(matches!(script.output()[..], [Frame::Transmit64 { to: OTHER, .. }]));
    script.driver.request(BeaconId(0)).expect("it is set up");
    script.wait(0.4);
    assert_eq!(script.poll(), None);
    assert_eq!(script.sent().1, b"ASK");
    script.report(&receive(71));
    assert_eq!(script.poll(), Some(-71.0));
}

#[test]
fn a_remote_answer_belongs_to_its_question() {
    let mut script = script(ZIGBEE, XbeeQuestion::RemoteDb, true);
    let query = |script: &mut Script<_>| {
        script.driver.request(BeaconId(0)).expect("it is set up");
        match script.output().pop() {
            Some(Frame::RemoteAtCommand { id, to64: BEACON, command: AtCommand::DB, .. }) => id,
            other => panic!("{other:?}"),
        }
    };
    let answer = |id, from64, level| Frame::RemoteAtResponse {
        id,
        from64,
        from16: Address16::UNKNOWN,
        command: AtCommand::DB,
        status: AtStatus::OK,
        value: vec![level],
    };
    let old = query(&mut script);
    let new = query(&mut script);
    for (id, from) in [(old, BEACON), (new, OTHER)] {
        script.report(&answer(id, from, 50));
        assert_eq!(script.poll(), None);
    }
    script.report(&answer(new, BEACON, 51));
    assert_eq!(script.poll(), Some(-51.0));
}

#[test]
fn a_question_that_cannot_be_sent_is_an_error_and_silence_is_none() {
    let mut mesh = script(ZIGBEE, XbeeQuestion::Auto, true);
    let status = |id, delivery| Frame::DeliveryStatus {
        id,
        to16: Address16::UNKNOWN,
        retries: 0,
        delivery: DeliveryStatus(delivery),
        discovery: 0,
    };
    let (id, data) = mesh.query();
    mesh.report(&status(id, 0x21));
    assert_eq!(mesh.poll(), None);
    mesh.packet(BEACON, &data);
    assert_eq!(mesh.poll(), None);
    mesh.db(44);
    assert_eq!(mesh.poll(), Some(-44.0), "the acknowledgement was lost, the answer was not");
    let (id, _) = mesh.query();
    mesh.report(&status(id, 0x22));
    let error = mesh.driver.poll().expect_err("it did not go out");
    assert!(matches!(&error, XbeeError::NotSent { .. }), "{error}");
    assert!(error.to_string().contains("not joined"), "{error}");
    assert_eq!(mesh.poll(), None, "reported once");

    let mut plain = script(PLAIN, XbeeQuestion::Auto, true);
    let (id, _) = plain.query();
    plain.report(&Frame::TransmitStatus { id, status: TransmitStatus(2) });
    assert!(plain.driver.poll().is_err());
}
