//! Replays, overviews and pictures, through the public interface.

mod pictures;
mod replay;
