/// The model of the residuals that a fitted pattern leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Residuals {
    /// As Gaussian noise, larger than the readings' scatter where they are, and correlated as they
    /// are.
    #[default]
    Gaussian,
    /// As noise with Student's t: a part of the pattern that does not fit loses its weight
    /// (Lange, Little & Taylor 1989).
    StudentT {
        /// The degrees of freedom; the fewer, the less weight. A number that is not positive counts
        /// as
        /// 1.
        degrees: f64,
    },
    /// As Gaussian noise about one path or two: a reflection of unknown direction, strength and
    /// phase may add its amplitude to the direct wave's, with a probability of 0.2 before the turn.
    /// The residuals of two paths are diffuse fading, Rician, so that the pattern's back weighs
    /// less than its main lobe. The one to use where the antenna is known.
    Reflection,
}
