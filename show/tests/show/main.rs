//! What is shown, through its public interface: replays, overviews, pictures.

mod pictures;
mod replay;
