//! Any bytes into the decoder of XBee frames, in either mode, divided anyhow.
#![no_main]

use foxhunt_wire::xbee::{ApiMode, Decoder, Frame, FrameError};
use libfuzzer_sys::fuzz_target;

fn decoded(mode: ApiMode, bytes: &[u8], chunk: usize) -> Vec<Result<Frame, FrameError>> {
    let mut decoder = Decoder::new(mode);
    let mut decoded: Vec<_> = bytes.chunks(chunk).flat_map(|some| decoder.push(some)).collect();
    decoded.extend(decoder.give_up());
    assert!(!decoder.is_waiting());
    decoded
}

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    for mode in [ApiMode::Plain, ApiMode::Escaped] {
        let all = decoded(mode, bytes, bytes.len().max(1));
        assert_eq!(all, decoded(mode, bytes, usize::from(*first).max(1)), "division matters");
        for frame in all.into_iter().flatten() {
            let again = frame.encode(mode).expect("it was short enough");
            assert_eq!(Frame::decode(&again, mode), Ok(frame), "it does not come back");
        }
        let _ = Frame::decode(bytes, mode);
    }
    let _ = Frame::from_data(bytes);
});
