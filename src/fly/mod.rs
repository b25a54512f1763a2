//! The hunt on real devices, or on the same devices emulated.
