//! Recordings: real files through the shipped mappings, our own format there and back, mistakes.

mod recordings {
    mod errors;
    mod real;
    mod round_trip;
    mod sweeps;
    mod values;
}
