//! foxhunt
fn main() {}
