use foxhunt_wire::xbee::{ApiMode, Decoder, Frame, FrameError, LONGEST_DATA};
use proptest::{collection::vec, prelude::*};

use crate::any::{bytes, frame};

const MODES: [ApiMode; 2] = [ApiMode::Plain, ApiMode::Escaped];

/// All that a decoder gives of bytes that come in chunks, and at their end.
fn decoded(mode: ApiMode, bytes: &[u8], chunk: usize) -> Vec<Result<Frame, FrameError>> {
    let mut decoder = Decoder::new(mode);
    let mut decoded: Vec<_> = bytes.chunks(chunk).flat_map(|some| decoder.push(some)).collect();
    decoded.extend(decoder.give_up());
    decoded
}

fn frames(decoded: Vec<Result<Frame, FrameError>>) -> Vec<Frame> {
    decoded.into_iter().filter_map(Result::ok).collect()
}

proptest! {
    #[test]
    fn frames_come_back_as_they_were(frame in frame()) {
        for mode in MODES {
            let bytes = frame.encode(mode).expect("it is short enough");
            prop_assert_eq!(Frame::decode(&bytes, mode), Ok(frame.clone()));
            prop_assert_eq!(Decoder::new(mode).push(&bytes), vec![Ok(frame.clone())]);
            if mode == ApiMode::Escaped {
                let special = |byte: &&u8| matches!(byte, 0x7E | 0x11 | 0x13);
                prop_assert_eq!(bytes.iter().filter(special).count(), 1);
            }
        }
    }

    #[test]
    fn whatever_comes_nothing_breaks_and_its_division_does_not_matter(
        bytes in bytes(1500), chunk in 1_usize..60,
    ) {
        for mode in MODES {
            let all = decoded(mode, &bytes, bytes.len().max(1));
            prop_assert_eq!(&all, &decoded(mode, &bytes, chunk));
            for frame in all.into_iter().flatten() {
                let again = frame.encode(mode).expect("it is short enough");
                prop_assert_eq!(Frame::decode(&again, mode), Ok(frame));
            }
            let _ = Frame::decode(&bytes, mode);
        }
        let _ = Frame::from_data(&bytes);
    }

    #[test]
    fn escaped_frames_are_found_between_anything(
        parts in vec((bytes(40), frame()), 1..8),
    ) {
        let mut stream = Vec::new();
        for (garbage, frame) in &parts {
            stream.extend(garbage);
            stream.extend(frame.encode(ApiMode::Escaped).expect("it is short enough"));
        }
        let found = frames(decoded(ApiMode::Escaped, &stream, 7));
        let mut rest = found.iter();
        for (_, sent) in &parts {
            prop_assert!(rest.any(|frame| frame == sent), "{sent:?} is lost");
        }
    }

    #[test]
    fn frames_are_found_between_what_begins_none(
        parts in vec((bytes(40), frame()), 1..8),
    ) {
        for mode in MODES {
            let mut stream = Vec::new();
            for (garbage, frame) in &parts {
                stream.extend(garbage.iter().filter(|byte| **byte != 0x7E));
                stream.extend(frame.encode(mode).expect("it is short enough"));
            }
            let all = decoded(mode, &stream, 5);
            let sent: Vec<_> = parts.iter().map(|(_, frame)| Ok(frame.clone())).collect();
            prop_assert_eq!(all, sent);
        }
    }

    #[test]
    fn a_cut_frame_does_not_swallow_the_next(
        cut in frame(), keep in 0.0..1.0, next in vec(frame(), 1..5),
    ) {
        for mode in MODES {
            let mut stream = cut.encode(mode).expect("it is short enough");
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss,
                clippy::cast_precision_loss, reason = "a share of a small length")]
            stream.truncate((stream.len() as f64 * keep) as usize);
            for frame in &next {
                stream.extend(frame.encode(mode).expect("it is short enough"));
            }
            let found = frames(decoded(mode, &stream, 9));
            // One checksum in 256 is right by chance; then it cannot be known what was meant.
            prop_assume!(found.iter().all(|frame| next.contains(frame)));
            prop_assert_eq!(&found, &next);
        }
    }
}

#[test]
fn what_is_too_long_is_not_sent() {
    let frame = |length| Frame::Unknown { frame_type: 0xA1, data: vec![0; length] };
    assert!(frame(LONGEST_DATA - 1).encode(ApiMode::Plain).is_ok());
    let refused = frame(LONGEST_DATA).encode(ApiMode::Plain);
    assert_eq!(refused, Err(FrameError::NoSuchLength { length: LONGEST_DATA + 1 }));
}
