use foxhunt_wire::mavlink::{
    Autopilot,
    dialect::{MavParamType, PARAM_VALUE_DATA},
};

/// The number of a parameter. PX4 has the bits of whole numbers in the field of a float, ArduPilot
/// floats (MAVLink's parameter protocol: bytewise and C-cast encodings).
pub(super) fn parameter(autopilot: Autopilot, message: &PARAM_VALUE_DATA) -> f64 {
    let bits = message.param_value.to_bits();
    match (autopilot, message.param_type) {
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_INT32) => f64::from(bits.cast_signed()),
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_UINT32) => f64::from(bits),
        _ => f64::from(message.param_value),
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_wire::mavlink::CharArray;

    use super::*;

    #[test]
    fn whole_numbers_of_px4_are_bits() {
        let message = |param_value, param_type| PARAM_VALUE_DATA {
            param_value,
            param_type,
            param_count: 1,
            param_index: 0,
            param_id: CharArray::from("X"),
        };
        let bits = message(f32::from_bits(3), MavParamType::MAV_PARAM_TYPE_INT32);
        assert!((parameter(Autopilot::Px4, &bits) - 3.0).abs() < 1e-9);
        let minus = message(f32::from_bits(u32::MAX), MavParamType::MAV_PARAM_TYPE_INT32);
        assert!((parameter(Autopilot::Px4, &minus) + 1.0).abs() < 1e-9);
        let cast = message(3.0, MavParamType::MAV_PARAM_TYPE_INT32);
        assert!((parameter(Autopilot::ArduPilot, &cast) - 3.0).abs() < 1e-9);
        let float = message(2.5, MavParamType::MAV_PARAM_TYPE_REAL32);
        assert!((parameter(Autopilot::Px4, &float) - 2.5).abs() < 1e-9);
    }
}
