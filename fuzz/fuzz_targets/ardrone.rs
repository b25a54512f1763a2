//! Any bytes as orders to an AR.Drone, and as its navdata.
#![no_main]

use foxhunt_wire::ardrone::{ArDroneNavdata, encode_commands, parse_commands};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(commands) = parse_commands(bytes) {
        let mut sequence = 1;
        let orders: Vec<_> = commands.into_iter().map(|(_, command)| command).collect();
        let encoded = encode_commands(&orders, &mut sequence);
        if encoded.len() <= 1024 {
            let read = parse_commands(&encoded).expect("our own orders are read");
            assert_eq!(read.len(), orders.len());
        }
    }
    if let Ok(navdata) = ArDroneNavdata::parse(bytes) {
        assert!(ArDroneNavdata::parse(&navdata.encode()).is_ok());
    }
    // A right head is hard to hit.
    let mut headed = 0x5566_7788_u32.to_le_bytes().to_vec();
    headed.extend(bytes);
    let _ = ArDroneNavdata::parse(&headed);
});
