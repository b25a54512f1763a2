use std::fmt;

use foxhunt_sim::ReliefConfig;
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, MapAccess, Visitor, value::MapAccessDeserializer},
};

/// Terrain that a model assumes.
///
/// In a file `terrain = true` for that of the world, or a table like it.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelTerrain {
    /// Terrain of the scenario's world, or of the flight: reading a file puts a copy in its place.
    AsThere,
    /// This one.
    Own(ReliefConfig),
}

impl Serialize for ModelTerrain {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::AsThere => serializer.serialize_bool(true),
            Self::Own(terrain) => terrain.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ModelTerrain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TrueOrTable)
    }
}

struct TrueOrTable;

impl<'de> Visitor<'de> for TrueOrTable {
    type Value = ModelTerrain;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("true, or a table of a terrain")
    }

    fn visit_bool<E: de::Error>(self, value: bool) -> Result<ModelTerrain, E> {
        if value {
            Ok(ModelTerrain::AsThere)
        } else {
            Err(E::custom("terrain is false; it must be left out where the ground is level"))
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ModelTerrain, A::Error> {
        ReliefConfig::deserialize(MapAccessDeserializer::new(map)).map(ModelTerrain::Own)
    }
}
