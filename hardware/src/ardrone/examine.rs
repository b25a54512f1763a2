use foxhunt_core::Clock;
use foxhunt_wire::ByteStream;

use super::ArDrone;
use crate::Finding;

impl<A: ByteStream, N: ByteStream, C: Clock> ArDrone<A, N, C> {
    /// Looks at it: its state and its battery. Nothing is ordered that moves anything. `pause` is
    /// called while it waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let begun = self.clock.now();
        // A clock that stands still does not keep us for ever.
        for _ in 0..1_000_000 {
            match self.serve() {
                Err(error) => {
                    let remedy = "join the drone's wireless network";
                    return vec![Finding::bad("link", error, remedy)];
                }
                Ok(now) if self.demo().is_some() || now - begun > 5.0 => break,
                Ok(_) => pause(),
            }
        }
        let Some(demo) = self.demo() else {
            let remedy =
                "join the drone's wireless network, and see that no other program flies it";
            return vec![Finding::bad("navdata", "nothing was received", remedy)];
        };
        let percent = demo.battery_percent;
        let battery = format!("{percent} % left");
        vec![
            Finding::good("navdata", format!("{:?}", demo.flight)),
            if percent < 30 {
                Finding::bad("battery", battery, "charge it before you fly")
            } else {
                Finding::good("battery", battery)
            },
            if self.state_is(|state| state.is_emergency()) {
                let remedy = "put it level on the ground; the next take-off ends the emergency";
                Finding::bad("emergency", "its motors are locked", remedy)
            } else {
                Finding::good("emergency", "none")
            },
        ]
    }
}
