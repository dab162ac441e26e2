use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use brdf::Brdf;
use csv::{ReaderBuilder, WriterBuilder};
use glam::DVec3;

use crate::coordinates::{ANGLES, HALF_DIFFERENCE, RECIPROCAL, folded};
use crate::lattice::Lattice;
use crate::refinement::{self, even, fitted};
use crate::text::{angle_deg, number, reflectance, written};
use crate::{Error, Export, Fidelity, Format, Place, Tolerance};

/// A table with one row a direction pair and wavelength, for spreadsheets and scripts.
pub(crate) const FORMAT: Format = Format {
    name: "csv-long",
    extension: "csv",
    about: "Text table, one row a pair of directions and wavelength: first every reading with its uncertainty and flags, then \
            the BRDF over a grid (flag \"model\"), of zenith angles and azimuth or, for narrow lobes, of half and difference \
            angles. Loses what lies between the nodes.",
    tolerance: Tolerance::TABLE,
    write,
    recognises: |bytes| {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]).into_owned();
        start.lines().any(|line| line.trim() == COLUMNS.join(","))
    },
    read,
};

/// The columns, angles in degrees; azimuths are those of the directions to the light and to the viewer.
const COLUMNS: [&str; 10] = [
    "theta_i_deg",
    "phi_i_deg",
    "theta_r_deg",
    "phi_r_deg",
    "lambda_nm",
    "f_per_sr",
    "u_f_per_sr",
    "flags",
    "run_id",
    "sample_idx",
];
/// The flag of rows that tell what the model says.
const MODEL: &str = "model";
/// Half and difference angles below this, rad, are rounding.
const DEGENERATE_RAD: f64 = 1e-6;
/// Most nodes of the grid.
const NODES: usize = 120_000;

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    for (name, value) in export.metadata.lines() {
        bytes.extend_from_slice(format!("# {name}: {value}\n").as_bytes());
    }
    let mut writer = WriterBuilder::new().from_writer(bytes);
    let library = |error: csv::Error| Error::Library {
        library: "csv",
        source: Box::new(error),
    };
    writer.write_record(COLUMNS).map_err(library)?;
    let run = export.metadata.run.as_str();
    let nm = export.metadata.wavelengths_nm.map(|nm| nm.to_string());
    let mut rows = |angles_rad: [f64; 4], f: Option<DVec3>, u: Option<DVec3>, flags: &str, index: &str| {
        let angles = angles_rad.map(|angle| format!("{:.10}", angle.to_degrees()));
        let cell = |value: Option<DVec3>, c: usize| value.map(|rgb| written(rgb[c])).unwrap_or_default();
        for (c, nm) in nm.iter().enumerate() {
            let [a, b, d, e] = angles.each_ref().map(String::as_str);
            writer
                .write_record([a, b, d, e, nm, &cell(f, c), &cell(u, c), flags, run, index])
                .map_err(library)?;
        }
        Ok(())
    };
    for r in export.readings {
        let angles = [r.theta_i_rad, r.phi_i_rad, r.theta_r_rad, r.phi_r_rad];
        rows(angles, r.f, r.u, &r.flags, &r.index.to_string())?;
    }
    for ([theta_i, theta_r, phi], f) in model(export.brdf) {
        rows([theta_i, 0.0, theta_r, phi], Some(f), None, MODEL, "")?;
    }
    writer.into_inner().map_err(|error| Error::Library {
        library: "csv",
        source: Box::new(error.into_error()),
    })
}

/// θ_i, θ_r and the azimuth between them, and what the BRDF is there: over a grid of these angles where that holds it,
/// else over a grid of half and difference angles, which resolves narrow lobes.
fn model(brdf: &dyn Brdf) -> Vec<([f64; 3], DVec3)> {
    let zenith = || even(0.0, 89.0_f64.to_radians(), 6);
    let start = [zenith(), zenith(), even(0.0, PI, 6)];
    let plain = fitted(ANGLES, start, brdf, &FORMAT.tolerance, NODES);
    if FORMAT
        .tolerance
        .exceeded(&Fidelity::between(brdf, &plain))
        .is_none()
    {
        return plain.nodes().collect();
    }
    let (table, _) = refinement::half_difference(brdf, &FORMAT.tolerance, NODES);
    let above = table.nodes().filter_map(|(angles, f)| {
        let (incident, exitant) = (HALF_DIFFERENCE.directions)(angles);
        // Where half vector and normal are the same, or the directions are, φ_d has no meaning.
        let once = angles[2] == 0.0 || (angles[0] > 0.0 && angles[1] > 0.0);
        (once && incident.z > 1e-6 && exitant.z > 1e-6).then(|| ((ANGLES.of)(incident, exitant), f))
    });
    above.collect()
}

/// What the rows of one pair of directions say: the pair's angles and the channels by wavelength.
type Pair = ([f64; 3], Vec<(f64, f64)>);

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    crate::text::text(bytes)?;
    let mut reader = ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let malformed = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        Error::malformed(Place::Line(line), error.to_string(), "ten columns")
    };
    let header = reader.headers().map_err(malformed)?;
    if header != COLUMNS.as_slice() {
        let found = crate::text::shortened(&header.iter().collect::<Vec<_>>().join(","));
        return Err(Error::malformed(
            Place::Line(1),
            format!("columns {found}"),
            COLUMNS.join(","),
        ));
    }
    // By the angles in units of 1e-10°; rows of the model apart from those of readings.
    let mut kinds: [BTreeMap<[i64; 3], Pair>; 2] = Default::default();
    for record in reader.records() {
        let record = record.map_err(malformed)?;
        let line = record.position().map_or(0, csv::Position::line);
        if record[5].is_empty() {
            continue;
        }
        let value = |column: usize| number(&record[column], line);
        let zenith = |column: usize| angle_deg(value(column)?, [0.0, 90.0], COLUMNS[column], line);
        let azimuth = |column: usize| angle_deg(value(column)?, [-360.0, 360.0], COLUMNS[column], line);
        let angles = [zenith(0)?, zenith(2)?, folded(azimuth(3)? - azimuth(1)?)];
        let key = angles.map(|angle| (angle.to_degrees() * 1e10).round() as i64);
        let kind = usize::from(&record[7] != MODEL);
        let pair = kinds[kind].entry(key).or_insert_with(|| (angles, Vec::new()));
        pair.1.push((value(4)?, reflectance(value(5)?, line)?));
    }
    let [model, readings] = kinds;
    let pairs = if model.is_empty() { readings } else { model };
    let nodes: Vec<([f64; 3], DVec3)> = pairs
        .into_values()
        .map(|(angles, mut channels)| {
            channels.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            channels.dedup_by_key(|(nm, _)| *nm);
            let nm: Vec<f64> = channels.iter().map(|(nm, _)| *nm).collect();
            let weights = crate::colour::channels_of_spectrum(&nm);
            let rgb: DVec3 = weights
                .iter()
                .zip(&channels)
                .map(|(weight, (_, f))| *weight * *f)
                .sum();
            (angles, rgb.max(DVec3::ZERO))
        })
        .collect();
    let plain = Lattice::from_nodes(ANGLES, ["theta_i", "theta_r", "phi"], &nodes, None);
    plain
        .or_else(|error| half_difference(&nodes).ok_or(error))
        .map(|table| Box::new(table) as Box<dyn Brdf>)
}

/// The table of rows that are a grid of half and difference angles, but for what lies below the horizon.
fn half_difference(nodes: &[([f64; 3], DVec3)]) -> Option<Lattice> {
    let pair = |&(angles, f): &([f64; 3], DVec3)| {
        let (incident, exitant) = (ANGLES.directions)(angles);
        let [theta_h, theta_d, phi_d] = (HALF_DIFFERENCE.of)(incident, exitant);
        let known = theta_h > DEGENERATE_RAD && theta_d > DEGENERATE_RAD;
        ([theta_h, theta_d, if known { phi_d } else { 0.0 }], f)
    };
    let nodes: Vec<_> = nodes.iter().map(pair).collect();
    // Where there is no φ_d beyond 90°, the others are the same by reciprocity.
    let reciprocal = nodes.iter().all(|([_, _, phi_d], _)| *phi_d < FRAC_PI_2 + 1e-3);
    let coordinates = if reciprocal { RECIPROCAL } else { HALF_DIFFERENCE };
    let names = ["theta_h", "theta_d", "phi_d"];
    Lattice::from_nodes(coordinates, names, &nodes, Some([2, 1, 0])).ok()
}
