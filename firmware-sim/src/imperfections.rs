use std::time::Duration;

/// By how much the simulated bench is not ideal. That counts are whole numbers and end at full scale stays with any
/// of them off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imperfections {
    /// Electrons per count at gain ×1, whose number is Poisson; 0: no shot noise.
    pub shot_noise_electrons: f64,
    /// Standard deviation of the converter, counts at any gain.
    pub read_noise_counts: f64,
    /// Dark counts per second at gain ×1 and 25 °C.
    pub dark_counts_per_s: f64,
    /// By how many °C the dark counts double; 0: they do not depend on temperature.
    pub dark_doubling_c: f64,
    /// Counts that a colour channel shows with no light and no time, at any gain.
    pub dark_offset_counts: f64,
    /// By how much the photometer becomes warmer than the room, °C, with a time constant of ten minutes.
    pub self_heating_c: f64,
    /// Light that reaches the sensor past the specimen while the lamp is on, as f·cos, sr⁻¹.
    pub stray_per_sr: f64,
    /// Light that reaches the sensor from the room, whether the lamp is on or not, as f·cos, sr⁻¹.
    pub room_light_per_sr: f64,
    /// How often a second it swells to twice its mean and fades to nothing, Hz; 0: it is steady.
    pub room_flicker_hz: f64,
    /// Time constant with which the lamp comes up.
    pub lamp_warm_up: Duration,
    /// Largest slow deviation from nominal output, relative.
    pub lamp_drift: f64,
    /// Amplitude of the 100 Hz ripple, relative.
    pub lamp_flicker: f64,
    /// Half angle of the source as the specimen sees it, degrees; 0: a point.
    pub source_aperture_deg: f64,
    /// Half angle of the detector as the specimen sees it, degrees; 0: a point.
    pub detector_aperture_deg: f64,
    /// Play between encoder and light arm, degrees of the arm.
    pub light_backlash_deg: f64,
    /// Play between encoder and sensor arm, degrees of the arm.
    pub sensor_backlash_deg: f64,
    /// By how much a shaft is late behind its profile.
    pub following_lag: Duration,
    /// By how much the photometer is more sensitive than the rig file says, relative.
    pub responsivity_error: f64,
    /// By how much the gain steps above ×1 amplify more than they should, relative.
    pub gain_error: f64,
    /// Share of the counts that is lost at full scale; the loss grows with their square.
    pub nonlinearity: f64,
    /// Share of each colour channel's light that comes from the two others, evenly.
    pub crosstalk: f64,
    /// By how much the lamp's output grows in an hour, relative to nominal; the monitor sees it too.
    pub lamp_trend_per_h: f64,
    /// Where the light arm really is when its encoder says 0, degrees.
    pub light_zero_deg: f64,
    /// Where the sensor arm really is when its encoder says 0, degrees.
    pub sensor_zero_deg: f64,
}

impl Imperfections {
    /// A modest but decent photometer: 0.1 % on a white specimen, a few percent on a black one away from its lobe. What
    /// only a calibration can remove is 0: the rig file is taken to be right. Servos of the X series as they are delivered:
    /// play by the e-manual ("Specifications", backlash 15 arcmin), lag by the factory's gains (docs/servos.md).
    pub const DEFAULT: Self = Self {
        shot_noise_electrons: 64.0,
        read_noise_counts: 3.0,
        dark_counts_per_s: 20.0,
        dark_doubling_c: 8.0,
        dark_offset_counts: 64.0,
        self_heating_c: 3.0,
        stray_per_sr: 1e-5,
        room_light_per_sr: 0.0,
        room_flicker_hz: 0.0,
        lamp_warm_up: Duration::from_millis(20),
        lamp_drift: 0.005,
        lamp_flicker: 0.001,
        source_aperture_deg: 0.25,
        detector_aperture_deg: 0.25,
        light_backlash_deg: 0.25,
        sensor_backlash_deg: 0.25,
        following_lag: Duration::from_millis(45),
        responsivity_error: 0.0,
        gain_error: 0.0,
        nonlinearity: 0.0,
        crosstalk: 0.0,
        lamp_trend_per_h: 0.0,
        light_zero_deg: 0.0,
        sensor_zero_deg: 0.0,
    };

    /// An ideal instrument.
    pub const NONE: Self = Self {
        shot_noise_electrons: 0.0,
        read_noise_counts: 0.0,
        dark_counts_per_s: 0.0,
        dark_doubling_c: 0.0,
        dark_offset_counts: 0.0,
        self_heating_c: 0.0,
        stray_per_sr: 0.0,
        room_light_per_sr: 0.0,
        room_flicker_hz: 0.0,
        lamp_warm_up: Duration::ZERO,
        lamp_drift: 0.0,
        lamp_flicker: 0.0,
        source_aperture_deg: 0.0,
        detector_aperture_deg: 0.0,
        light_backlash_deg: 0.0,
        sensor_backlash_deg: 0.0,
        following_lag: Duration::ZERO,
        responsivity_error: 0.0,
        gain_error: 0.0,
        nonlinearity: 0.0,
        crosstalk: 0.0,
        lamp_trend_per_h: 0.0,
        light_zero_deg: 0.0,
        sensor_zero_deg: 0.0,
    };
}

impl Default for Imperfections {
    fn default() -> Self {
        Self::DEFAULT
    }
}
