//! Any bytes as MAVLink, in pieces of any length, with and without a key.
#![no_main]

use foxhunt_wire::mavlink::{Codec, Signing, SigningKey};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: (u8, bool, &[u8])| {
    let (piece, signed, bytes) = input;
    let codec = Codec::new(255, 190);
    let mut codec =
        if signed { codec.with_signing(Signing::new(SigningKey::new([7; 32]), 1)) } else { codec };
    for some in bytes.chunks(usize::from(piece).max(1)) {
        codec.push(some);
        while let Some(frame) = codec.next_frame(1.8e9) {
            // What was decoded can be encoded.
            let mut back = Codec::new(1, 1);
            let encoded = Codec::new(2, 2).encode(&frame.message, 0.0);
            back.push(&encoded);
            assert!(back.next_frame(0.0).is_some());
        }
    }
    let counts = codec.counts();
    assert!(counts.garbage_bytes <= bytes.len() as u64);
    // Whatever came before, a frame is found after a pause.
    codec.push(&[0; 600]);
    while codec.next_frame(1.8e9).is_some() {}
});
