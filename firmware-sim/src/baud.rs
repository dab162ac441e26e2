//! Values of the Baud Rate register (e-manual, "Baud Rate").

const RATES: [u32; 8] = [
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000,
];

/// Bits per second for a register value within its range.
pub(crate) fn rate(code: u8) -> u32 {
    RATES[usize::from(code).min(RATES.len() - 1)]
}

/// Register value for bits per second.
pub(crate) fn code(rate: u32) -> Option<u8> {
    let code = RATES.iter().position(|&known| known == rate)?;
    u8::try_from(code).ok()
}
