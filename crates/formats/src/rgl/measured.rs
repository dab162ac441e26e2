use std::f64::consts::{FRAC_PI_2, PI, TAU};

use brdf::{Brdf, Spherical};
use glam::{DVec2, DVec3};

use super::tensor::{Kind, Tensor};
use super::warp::Warp;
use crate::colour::channels_of_spectrum;
use crate::{Error, Place};

/// Largest value of an angle of incidence that a file may have, rad: a little more than 90°.
const THETA_MAX: f64 = FRAC_PI_2 + 1e-3;
/// Most numbers in a table; what is larger comes of no measurement.
const MOST_NODES: usize = 1 << 26;

/// The BRDF of a tensor file: f cos θ_o = S(s) D(m) / (4 σ(θ_i)), s being where the microfacet normal m lies after the
/// density of visible normals is evened out.
///
/// As Mitsuba does, it multiplies by D and divides by 4 σ where the field `jacobian` is not 0.
pub(crate) struct Measured {
    ndf: Plane,
    sigma: Plane,
    pub(crate) vndf: Warp,
    /// Nodes of a side of the square of s.
    side: usize,
    /// Per angle of incidence, row by row, RGB.
    values: Vec<DVec3>,
    jacobian: bool,
}

impl Measured {
    /// A BRDF from its tables.
    pub(crate) fn new(ndf: Plane, sigma: Plane, vndf: Warp, side: usize, values: Vec<DVec3>) -> Self {
        Self {
            ndf,
            sigma,
            vndf,
            side,
            values,
            jacobian: true,
        }
    }

    /// Reads the bytes of a tensor file.
    ///
    /// # Errors
    /// A field is missing, of another type, or does not fit the others; a specimen that is not isotropic.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, Error> {
        let tensor = Tensor::read(bytes)?;
        let ([azimuths], _) = tensor.floats::<1>("phi_i")?;
        if azimuths > 2 {
            let found = format!("{azimuths} azimuths of incidence");
            return Err(refuse("phi_i", found, "1 or 2: an isotropic specimen"));
        }
        let ([t], theta_i) = tensor.floats::<1>("theta_i")?;
        let within = theta_i.iter().all(|theta| (-1e-6..=THETA_MAX).contains(theta));
        if !(within && theta_i.is_sorted_by(|a, b| a < b)) {
            return Err(refuse("theta_i", "others", "ascending angles of 0 … π/2 rad"));
        }
        let jacobian = tensor.0.iter().find(|field| field.name == b"jacobian");
        let jacobian = jacobian.filter(|field| field.kind == Kind::U8 && field.data.len() == 1);
        let (side, values) = values(&tensor, azimuths, t)?;
        Ok(Self {
            ndf: Plane::read(&tensor, "ndf")?,
            sigma: Plane::read(&tensor, "sigma")?,
            vndf: normals(&tensor, azimuths, theta_i)?,
            side,
            values,
            jacobian: match jacobian {
                Some(field) => field.data[0] != 0,
                None => return Err(refuse("jacobian", "none", "an array of one byte")),
            },
        })
    }

    fn at(&self, (t, part): (usize, f64), s: [f64; 2]) -> DVec3 {
        let area = self.side * self.side;
        let [x, y] = s.map(|s| {
            let at = s.clamp(0.0, 1.0) * (self.side - 1) as f64;
            let index = (at as usize).min(self.side - 2);
            (index, at - index as f64)
        });
        let slice = |t: usize| {
            let at = t * area + y.0 * self.side + x.0;
            let low = self.values[at].lerp(self.values[at + 1], x.1);
            let high = self.values[at + self.side].lerp(self.values[at + self.side + 1], x.1);
            low.lerp(high, y.1)
        };
        let low = slice(t);
        if part == 0.0 {
            low
        } else {
            low.lerp(slice(t + 1), part)
        }
    }
}

impl Brdf for Measured {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let (i, m) = (
            Spherical::from_direction(incident),
            Spherical::from_direction(incident + exitant),
        );
        let u = [u_of_theta(m.theta), u_of_phi(m.phi - i.phi)];
        let slices = self.vndf.slices(i.theta);
        let (s, _) = self.vndf.invert(slices, u);
        let scale = match self.jacobian {
            true => self.ndf.at(u) / (4.0 * self.sigma.at([u_of_theta(i.theta), 0.5])).max(f64::MIN_POSITIVE),
            false => 1.0,
        };
        let value = self.at(slices, s) * (scale / exitant.z);
        // Products of finite numbers may still be too large.
        let finite = value.min(DVec3::splat(crate::text::LARGEST)).max(DVec3::ZERO);
        DVec3::select(finite.is_finite_mask(), finite, DVec3::ZERO)
    }
}

/// An error in a field.
fn refuse(field: &str, found: impl Into<String>, allowed: impl Into<String>) -> Error {
    Error::malformed(Place::Field(field.into()), found, allowed)
}

/// The densities of visible normals; those of another azimuth of incidence are the same.
fn normals(tensor: &Tensor<'_>, azimuths: usize, theta_i: Vec<f64>) -> Result<Warp, Error> {
    let (shape, mut density) = tensor.floats::<4>("vndf")?;
    let (t, [_, _, rows, columns]) = (theta_i.len(), shape);
    if shape[..2] != [azimuths, t] || rows < 2 || columns < 2 || density.len() > MOST_NODES {
        let allowed = format!("{azimuths} × {t} × n × m with n and m from 2");
        return Err(refuse("vndf", format!("shape {shape:?}"), allowed));
    }
    density.truncate(t * rows * columns);
    density.iter_mut().for_each(|density| *density = density.max(0.0));
    Ok(Warp::new(theta_i, rows, columns, density))
}

/// The nodes of a side of the square of s and what is stored there, RGB.
fn values(tensor: &Tensor<'_>, azimuths: usize, t: usize) -> Result<(usize, Vec<DVec3>), Error> {
    let (name, weights) = if tensor.has(b"rgb") {
        ("rgb", vec![DVec3::X, DVec3::Y, DVec3::Z])
    } else {
        let (_, nm) = tensor.floats::<1>("wavelengths")?;
        if !nm.is_sorted_by(|a, b| a < b) {
            return Err(refuse("wavelengths", "others", "ascending wavelengths in nm"));
        }
        ("spectra", channels_of_spectrum(&nm))
    };
    let (shape, table) = tensor.floats::<5>(name)?;
    let side = shape[3];
    let fits = shape[..3] == [azimuths, t, weights.len()] && shape[4] == side && side >= 2;
    if !fits || table.len() > MOST_NODES {
        let allowed = format!("{azimuths} × {t} × {} × m × m with m from 2", weights.len());
        return Err(refuse(name, format!("shape {shape:?}"), allowed));
    }
    let area = side * side;
    let mut values = vec![DVec3::ZERO; t * area];
    for (at, value) in values.iter_mut().enumerate() {
        let (slice, node) = (at / area, at % area);
        for (c, weight) in weights.iter().enumerate() {
            *value += *weight * table[(slice * weights.len() + c) * area + node];
        }
    }
    Ok((side, values))
}

/// A table over the unit square of θ and φ, bilinear.
pub(crate) struct Plane {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Plane {
    /// A table that depends on θ alone.
    pub(crate) fn of_theta(values: Vec<f64>) -> Self {
        Self {
            rows: 1,
            columns: values.len(),
            values,
        }
    }

    fn read(tensor: &Tensor<'_>, name: &str) -> Result<Self, Error> {
        let ([rows, columns], values) = tensor.floats::<2>(name)?;
        Ok(Self {
            rows,
            columns,
            values,
        })
    }

    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let place = |u: f64, nodes: usize| {
            let at = u.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let index = (at as usize).min(nodes.saturating_sub(2));
            (index, at - index as f64)
        };
        let ((column, tx), (row, ty)) = (place(x, self.columns), place(y, self.rows));
        let along = |row: usize| {
            let at = |column: usize| self.values[row * self.columns + column.min(self.columns - 1)];
            (1.0 - tx) * at(column) + tx * at(column + 1)
        };
        (1.0 - ty) * along(row) + ty * along((row + 1).min(self.rows - 1))
    }
}

/// u of a zenith angle: θ = u² π/2.
pub(crate) fn u_of_theta(theta: f64) -> f64 {
    (theta / FRAC_PI_2).max(0.0).sqrt()
}

/// u of an azimuth: φ = (2u − 1) π, taken into 0 … 1.
pub(crate) fn u_of_phi(phi: f64) -> f64 {
    ((phi + PI) / TAU).rem_euclid(1.0)
}

/// The microfacet normal at a place of the unit square, for light at azimuth 0.
pub(crate) fn normal([x, y]: [f64; 2]) -> DVec3 {
    let (sin, cos) = (x * x * FRAC_PI_2).sin_cos();
    let across = DVec2::from_angle((2.0 * y - 1.0) * PI) * sin;
    across.extend(cos)
}
