//! Any bytes from and to rtl_tcp.
#![no_main]

use foxhunt_wire::receivers::{NarrowBand, RtlTcpCommand, RtlTcpHeader};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Some(header) = bytes.first_chunk()
        && let Ok(read) = RtlTcpHeader::decode(*header)
    {
        assert_eq!(read.encode(), *header);
    }
    for command in bytes.as_chunks().0 {
        let command = RtlTcpCommand::decode(*command);
        assert_eq!(RtlTcpCommand::decode(command.encode()), command);
    }
    let Some((numbers, samples)) = bytes.split_first_chunk::<24>() else { return };
    let [rate, offset, width] = [0, 8, 16].map(|at| {
        let mut number = [0; 8];
        number.copy_from_slice(&numbers[at..at + 8]);
        f64::from_le_bytes(number)
    });
    let bands = [NarrowBand::new(rate, offset, width), NarrowBand::new(250e3, 3e4, 5e4)];
    for mut band in bands.into_iter().flatten() {
        band.push(samples, |power| assert!((0.0..=2.0 + 1e-9).contains(&power), "{power}"));
    }
});
