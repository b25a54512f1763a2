//! Any frame.

use foxhunt_wire::xbee::{
    Address16, Address64, AtCommand, AtStatus, DeliveryStatus, Frame, ModemStatus, TransmitStatus,
};
use proptest::{collection::vec, prelude::*};

/// Bytes, most of them such as frames are made of.
pub(crate) fn bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![
        Just(0x7E_u8),
        Just(0x7D),
        Just(0x11),
        Just(0x13),
        Just(0x00),
        Just(0x01),
        any::<u8>()
    ];
    vec(byte, 0..most)
}

fn a64() -> impl Strategy<Value = Address64> {
    prop_oneof![Just(Address64::BROADCAST), any::<u64>().prop_map(Address64)]
}

fn a16() -> impl Strategy<Value = Address16> {
    prop_oneof![Just(Address16::UNKNOWN), any::<u16>().prop_map(Address16)]
}

fn command() -> impl Strategy<Value = AtCommand> {
    any::<[u8; 2]>().prop_map(AtCommand)
}

fn sent() -> impl Strategy<Value = Frame> {
    let byte = any::<u8>;
    prop_oneof![
        (byte(), a64(), byte(), bytes(100)).prop_map(|(id, to, options, data)| Frame::Transmit64 {
            id,
            to,
            options,
            data
        }),
        (byte(), a16(), byte(), bytes(100)).prop_map(|(id, to, options, data)| Frame::Transmit16 {
            id,
            to,
            options,
            data
        }),
        (byte(), command(), bytes(30)).prop_map(|(id, command, parameter)| Frame::AtCommand {
            id,
            command,
            parameter
        }),
        (byte(), command(), bytes(30))
            .prop_map(|(id, command, parameter)| Frame::QueuedAtCommand { id, command, parameter }),
        (byte(), a64(), a16(), byte(), byte(), bytes(300)).prop_map(
            |(id, to64, to16, broadcast_radius, options, data)| Frame::Transmit {
                id,
                to64,
                to16,
                broadcast_radius,
                options,
                data
            }
        ),
        (byte(), a64(), a16(), any::<[u8; 4]>(), any::<[u16; 2]>(), bytes(300)).prop_map(
            |(id, to64, to16, few, wide, data)| Frame::ExplicitTransmit {
                id,
                to64,
                to16,
                source_endpoint: few[0],
                destination_endpoint: few[1],
                cluster: wide[0],
                profile: wide[1],
                broadcast_radius: few[2],
                options: few[3],
                data
            }
        ),
        (byte(), a64(), a16(), byte(), command(), bytes(30)).prop_map(
            |(id, to64, to16, options, command, parameter)| Frame::RemoteAtCommand {
                id,
                to64,
                to16,
                options,
                command,
                parameter
            }
        ),
    ]
}

fn received() -> impl Strategy<Value = Frame> {
    let byte = any::<u8>;
    let status = || byte().prop_map(AtStatus);
    prop_oneof![
        (a64(), byte(), byte(), bytes(100)).prop_map(|(from, rssi_neg_dbm, options, data)| {
            Frame::Receive64 { from, rssi_neg_dbm, options, data }
        }),
        (a16(), byte(), byte(), bytes(100)).prop_map(|(from, rssi_neg_dbm, options, data)| {
            Frame::Receive16 { from, rssi_neg_dbm, options, data }
        }),
        (byte(), command(), status(), bytes(60)).prop_map(|(id, command, status, value)| {
            Frame::AtResponse { id, command, status, value }
        }),
        any::<[u8; 2]>()
            .prop_map(|[id, s]| Frame::TransmitStatus { id, status: TransmitStatus(s) }),
        byte().prop_map(|s| Frame::ModemStatus { status: ModemStatus(s) }),
        (a16(), any::<[u8; 4]>()).prop_map(|(to16, [id, retries, delivery, discovery])| {
            let delivery = DeliveryStatus(delivery);
            Frame::DeliveryStatus { id, to16, retries, delivery, discovery }
        }),
        (a64(), a16(), byte(), bytes(300)).prop_map(|(from64, from16, options, data)| {
            Frame::Receive { from64, from16, options, data }
        }),
        (a64(), a16(), any::<[u8; 3]>(), any::<[u16; 2]>(), bytes(300)).prop_map(
            |(from64, from16, few, wide, data)| Frame::ExplicitReceive {
                from64,
                from16,
                source_endpoint: few[0],
                destination_endpoint: few[1],
                cluster: wide[0],
                profile: wide[1],
                options: few[2],
                data
            }
        ),
        (byte(), a64(), a16(), command(), status(), bytes(60)).prop_map(
            |(id, from64, from16, command, status, value)| Frame::RemoteAtResponse {
                id,
                from64,
                from16,
                command,
                status,
                value
            }
        ),
        (0xA0_u8..=0xFF, bytes(100))
            .prop_map(|(frame_type, data)| Frame::Unknown { frame_type, data }),
    ]
}

pub(crate) fn frame() -> impl Strategy<Value = Frame> {
    prop_oneof![sent(), received()]
}
