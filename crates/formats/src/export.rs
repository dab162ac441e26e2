use brdf::Brdf;
use glam::DVec3;

/// What is written into a file: a BRDF, the readings that it rests on, and what is known of both.
pub struct Export<'a> {
    /// The BRDF; formats sample it wherever they need it.
    pub brdf: &'a dyn Brdf,
    /// The readings, in the order in which they were taken; empty where there are none.
    pub readings: &'a [Reading],
    /// What is known of specimen and measurement.
    pub metadata: Metadata,
}

impl<'a> Export<'a> {
    /// A BRDF of which nothing but a name is known.
    pub fn of(brdf: &'a dyn Brdf, specimen: &str) -> Self {
        Self {
            brdf,
            readings: &[],
            metadata: Metadata {
                specimen: specimen.to_owned(),
                ..Metadata::default()
            },
        }
    }
}

/// One reading of a gonio-reflectometer.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Number of the reading within its run, from 0.
    pub index: usize,
    /// Zenith angle of the light, rad, 0 … π/2.
    pub theta_i_rad: f64,
    /// Azimuth of the light, rad.
    pub phi_i_rad: f64,
    /// Zenith angle of the viewer, rad, 0 … π/2.
    pub theta_r_rad: f64,
    /// Azimuth of the viewer, rad; π from that of the light on the mirror side.
    pub phi_r_rad: f64,
    /// Reflectance, linear RGB in sr⁻¹; `None` where the reading has none.
    pub f: Option<DVec3>,
    /// Expanded uncertainty of the reflectance (k = 2), sr⁻¹; `None` where it is not known.
    pub u: Option<DVec3>,
    /// Flags, separated by `|`; empty where there are none.
    pub flags: String,
}

/// What is known of a specimen and of how it was measured.
///
/// A format keeps of it what it has a place for.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// Name of the specimen.
    pub specimen: String,
    /// When it was measured, RFC 3339; empty where it is not known.
    pub date: String,
    /// With what it was measured; empty where it is not known.
    pub instrument: String,
    /// Id of the run; empty where there was none.
    pub run: String,
    /// Half angles of light source and detector as seen from the specimen, degrees; `None` where they are not known.
    pub apertures_deg: Option<[f64; 2]>,
    /// Solid angle of the detector as seen from the specimen, sr; `None` where it is not known.
    pub solid_angle_sr: Option<f64>,
    /// Wavelengths that stand for red, green and blue, nm, descending.
    pub wavelengths_nm: [f64; 3],
    /// What is known of the uncertainty, in words; empty where nothing is.
    pub uncertainty: String,
    /// What else the record of the run says, such as material, operator and rig: name and value.
    pub record: Vec<(&'static str, String)>,
}

impl Default for Metadata {
    /// Nothing is known; the channels stand at [`Metadata::WAVELENGTHS_NM`].
    fn default() -> Self {
        Self {
            specimen: String::new(),
            date: String::new(),
            instrument: String::new(),
            run: String::new(),
            apertures_deg: None,
            solid_angle_sr: None,
            wavelengths_nm: Self::WAVELENGTHS_NM,
            uncertainty: String::new(),
            record: Vec::new(),
        }
    }
}

impl Metadata {
    /// Wavelengths of red, green and blue where the detector's are not known, nm: dominant wavelengths of the primaries
    /// of sRGB (IEC 61966-2-1), rounded to 5 nm.
    pub const WAVELENGTHS_NM: [f64; 3] = [610.0, 550.0, 465.0];

    /// Name and value of everything that is known, for headers and comments; control characters become spaces.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let clean = |text: &str| text.replace(char::is_control, " ").trim().to_owned();
        let [red, green, blue] = self.wavelengths_nm;
        let apertures = self
            .apertures_deg
            .map(|[light, sensor]| format!("{light} {sensor}"));
        let solid_angle = self.solid_angle_sr.map(|sr| sr.to_string());
        [
            ("specimen", clean(&self.specimen)),
            ("date", clean(&self.date)),
            ("instrument", clean(&self.instrument)),
            ("run", clean(&self.run)),
            ("apertures_deg", apertures.unwrap_or_default()),
            ("solid_angle_sr", solid_angle.unwrap_or_default()),
            ("wavelengths_nm", format!("{red} {green} {blue}")),
            ("uncertainty", clean(&self.uncertainty)),
        ]
        .into_iter()
        .chain(self.record.iter().map(|(name, value)| (*name, clean(value))))
        .filter(|(_, value)| !value.is_empty())
        .collect()
    }
}
