//! Any bytes into the decoders of Firmata, in both directions.
#![no_main]

use foxhunt_wire::firmata::{Decoder, Message, Reply, Request};
use libfuzzer_sys::fuzz_target;

fn comes_back<M: Message + PartialEq + std::fmt::Debug>(bytes: &[u8]) {
    let mut decoder = Decoder::<M>::default();
    for message in bytes.iter().filter_map(|byte| decoder.push(*byte)) {
        let mut again = Vec::new();
        message.encode(&mut again).expect("what was read has room");
        let mut second = Decoder::<M>::default();
        let decoded: Vec<M> = again.iter().filter_map(|byte| second.push(*byte)).collect();
        assert_eq!(decoded, [message], "it does not come back");
    }
}

fuzz_target!(|bytes: &[u8]| {
    comes_back::<Request>(bytes);
    comes_back::<Reply>(bytes);
});
