//! The link over ROS 2, by DDS.

mod drone;
mod fusion;
mod header;
mod node;

pub use drone::Ros2Drone;
pub use fusion::Ros2Fusion;
pub use node::Ros2Config;

use header::Header;
use node::Node;

#[cfg(test)]
mod tests {
    use ros2_client::dds::rustdds::{
        CDRDeserializerAdapter, CDRSerializerAdapter, RepresentationIdentifier,
        no_key::{DeserializerAdapter, SerializerAdapter},
    };

    use super::Header;
    use crate::link::ros;

    /// The four lists at the end of a reception, empty.
    const TAIL: usize = 4 * size_of::<u32>();

    fn read(bytes: &[u8]) -> Option<ros::Reception<Header>> {
        CDRDeserializerAdapter::from_bytes(bytes, RepresentationIdentifier::CDR_LE).ok()
    }

    #[test]
    fn a_reception_of_an_older_sender_is_read() {
        let sent = ros::Reception::<Header> {
            heard: true,
            rss_dbm: -61.5,
            position_sigma: vec![1.0, 1.0, 2.0],
            ..ros::Reception::default()
        };
        let bytes = CDRSerializerAdapter::<ros::Reception<Header>>::to_bytes(&sent);
        let bytes = bytes.expect("plain data");
        for end in [bytes.len(), bytes.len() - TAIL] {
            let read = read(&bytes[..end]);
            assert_eq!(read.as_ref(), Some(&sent), "{end} of {} bytes", bytes.len());
        }
        assert_eq!(read(&bytes[..bytes.len() - TAIL - 1]), None);
    }
}
