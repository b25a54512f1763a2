/// The bytes at an offset, as many as the array has; `None` beyond the end.
pub(super) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    let end = at.checked_add(N)?;
    bytes.get(at..end)?.try_into().ok()
}

/// A number at an offset, by the name of its type in C.
pub(super) fn number(bytes: &[u8], at: usize, kind: &str) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "microseconds of a flight are below 2^53")]
    Some(match kind {
        "uint8_t" | "bool" | "char" => f64::from(u8::from_le_bytes(array(bytes, at)?)),
        "int8_t" => f64::from(i8::from_le_bytes(array(bytes, at)?)),
        "uint16_t" => f64::from(u16::from_le_bytes(array(bytes, at)?)),
        "int16_t" => f64::from(i16::from_le_bytes(array(bytes, at)?)),
        "uint32_t" => f64::from(u32::from_le_bytes(array(bytes, at)?)),
        "int32_t" => f64::from(i32::from_le_bytes(array(bytes, at)?)),
        "uint64_t" => u64::from_le_bytes(array(bytes, at)?) as f64,
        "int64_t" => i64::from_le_bytes(array(bytes, at)?) as f64,
        "float" => f64::from(f32::from_le_bytes(array(bytes, at)?)),
        "double" => f64::from_le_bytes(array(bytes, at)?),
        _ => return None,
    })
}

/// The size of a type in bytes.
pub(super) fn size(kind: &str) -> Option<usize> {
    Some(match kind {
        "uint8_t" | "int8_t" | "bool" | "char" => 1,
        "uint16_t" | "int16_t" => 2,
        "uint32_t" | "int32_t" | "float" => 4,
        "uint64_t" | "int64_t" | "double" => 8,
        _ => return None,
    })
}
