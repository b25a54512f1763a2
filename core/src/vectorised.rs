//! Loops over columns, compiled once more for wide vectors.

/// A loop that runs on wide vectors where the processor has them. There is no fused multiplication
/// and no sum whose order is left open in one, so that its bits are the same everywhere.
pub trait Kernel {
    /// The loop's result.
    type Output;

    /// Runs the loop; `#[inline(always)]`, as is everything in it that shall be vectorised.
    fn run(self) -> Self::Output;
}

/// Runs a kernel on the widest vectors that there are.
///
/// ```
/// use foxhunt_core::{elementary, vectorised::{self, Kernel}};
///
/// /// Sets each number to its logarithm.
/// struct Logarithms<'a>(&'a mut [f64]);
///
/// impl Kernel for Logarithms<'_> {
///     type Output = ();
///
///     #[inline(always)]
///     fn run(self) {
///         self.0.iter_mut().for_each(|x| *x = elementary::ln(*x));
///     }
/// }
///
/// let mut numbers = [1.0, 1.0];
/// vectorised::run(Logarithms(&mut numbers));
/// assert_eq!(numbers, [0.0, 0.0]);
/// ```
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(feature = "std")]
    return pulp::Arch::new().dispatch(Dispatched(kernel));
    #[cfg(not(feature = "std"))]
    return kernel.run();
}

#[cfg(feature = "std")]
struct Dispatched<K>(K);

#[cfg(feature = "std")]
impl<K: Kernel> pulp::WithSimd for Dispatched<K> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> K::Output {
        self.0.run()
    }
}
