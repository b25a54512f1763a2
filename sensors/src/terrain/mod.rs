//! Loss of level by the ground between two antennas.

mod diffraction;
#[cfg(feature = "alloc")]
mod hills;
mod loss;
#[cfg(feature = "alloc")]
mod raster;

pub use diffraction::{fresnel_parameter, knife_edge_loss_db};
#[cfg(feature = "alloc")]
pub use hills::{Hill, Hills};
pub use loss::TerrainLoss;
#[cfg(feature = "alloc")]
pub use raster::HeightRaster;

/// A terrain shared by worlds and models.
#[cfg(feature = "alloc")]
pub type SharedTerrain = alloc::sync::Arc<dyn foxhunt_core::Terrain + Send + Sync>;
