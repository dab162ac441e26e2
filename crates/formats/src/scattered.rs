use std::path::Path;

use brdf::Spherical;
use glam::DVec3;

use crate::text::{LARGEST, angle_deg, lines, number, text};
use crate::{Error, Place};

/// Columns: two zenith angles, the azimuth, three channels.
const COLUMNS: usize = 6;

/// A reading of an instrument that stands anywhere above the specimen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScatteredReading {
    /// Zenith angle of the light, rad, 0 … π/2.
    pub light: f64,
    /// Zenith angle of the sensor, rad, 0 … π/2.
    pub sensor: f64,
    /// Azimuth between them, rad: π on the side of the mirror direction, 0 on that of retro-reflection.
    pub azimuth: f64,
    /// Reflectance, linear RGB in sr⁻¹, as it was read: noise may make it negative.
    pub rgb: DVec3,
}

impl ScatteredReading {
    /// Reads the CSV text of scattered readings: a header line, then rows of the zenith angles of light and sensor and the
    /// azimuth between them, in degrees, and the reflectance in red, green and blue, sr⁻¹. Empty lines and lines that
    /// begin with `#` are passed over.
    ///
    /// # Errors
    /// A row without six finite numbers, a zenith angle outside of 0 … 90°, a reflectance above 1e12 sr⁻¹, or no row.
    ///
    /// ```
    /// use formats::ScatteredReading;
    ///
    /// let text = b"theta_i_deg,theta_o_deg,dphi_deg,f_r,f_g,f_b\n20,20,180,0.5,0.4,0.3\n";
    /// let readings = ScatteredReading::parse(text)?;
    /// assert_eq!(readings[0].rgb.z, 0.3);
    /// assert!((readings[0].azimuth - std::f64::consts::PI).abs() < 1e-12);
    /// assert!(ScatteredReading::parse(b"theta_i_deg\n20\n").is_err());
    /// # Ok::<(), formats::Error>(())
    /// ```
    pub fn parse(bytes: &[u8]) -> Result<Vec<Self>, Error> {
        let rows = lines(text(bytes)?).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let readings: Vec<Self> = rows
            .skip(1)
            .map(|(at, line)| Self::row(line, at))
            .collect::<Result<_, _>>()?;
        match readings.is_empty() {
            true => Err(Error::malformed(
                Place::Line(1),
                "no line but the header",
                "a header line and at least one row",
            )),
            false => Ok(readings),
        }
    }

    /// Reads a file as [`ScatteredReading::parse`] does.
    ///
    /// # Errors
    /// The file cannot be read, or as for [`ScatteredReading::parse`].
    pub fn read(path: &Path) -> Result<Vec<Self>, Error> {
        let bytes = std::fs::read(path).map_err(|source| Error::Io {
            what: "read",
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&bytes).map_err(|source| Error::File {
            path: path.to_owned(),
            format: "scattered readings",
            source: Box::new(source),
        })
    }

    fn row(line: &str, at: u64) -> Result<Self, Error> {
        let cells: Vec<f64> = line
            .split(',')
            .map(|word| number(word, at))
            .collect::<Result<_, _>>()?;
        let [light, sensor, azimuth, r, g, b] = cells[..] else {
            return Err(Error::malformed(
                Place::Line(at),
                format!("{} cells", cells.len()),
                format!("{COLUMNS} cells"),
            ));
        };
        let rgb = DVec3::new(r, g, b);
        if rgb.max_element() > LARGEST {
            return Err(Error::malformed(
                Place::Line(at),
                format!("a reflectance of {} 1/sr", rgb.max_element()),
                format!("at most {LARGEST:e} 1/sr"),
            ));
        }
        Ok(Self {
            light: angle_deg(light, [0.0, 90.0], "a zenith angle of the light", at)?,
            sensor: angle_deg(sensor, [0.0, 90.0], "a zenith angle of the sensor", at)?,
            azimuth: azimuth.to_radians(),
            rgb,
        })
    }

    /// Light and sensor exchanged, which changes nothing in a reciprocal specimen.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self {
            light: self.sensor,
            sensor: self.light,
            ..self
        }
    }

    /// Unit vectors to the light and to the sensor, the sensor at azimuth 0.
    pub fn directions(&self) -> (DVec3, DVec3) {
        let [light, sensor] = [(self.light, self.azimuth), (self.sensor, 0.0)]
            .map(|(theta, phi)| Spherical { theta, phi }.direction());
        (light, sensor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_error_names_the_line_and_what_is_allowed() {
        let of = |text: &str| ScatteredReading::parse(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(
            of("a,b,c,d,e,f\n\n1,2,3,4,5\n"),
            "line 3: 5 cells; allowed is 6 cells"
        );
        assert!(of("h\n1,2,3,x,5,6\n").starts_with("line 2: \"x\""));
        assert!(of("h\n91,2,3,4,5,6\n").contains("0° … 90°"));
        assert!(of("h\n").contains("no line but the header"));
    }

    proptest! {
        #[test]
        fn prop_any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = ScatteredReading::parse(&bytes);
        }
    }
}
