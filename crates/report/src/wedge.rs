use capture::Record;
use pdv::{Placement, WedgeReading};
use rig::{Filling, MIN_COSINE, RigFile};

use crate::measurement::certificate;
use crate::{Measurement, ReportError, measurements};

/// What a run says of its specimen when that lay on a wedge throughout, by its true directions: every reading of a plane, a leg
/// or the arc that counts, was not in shadow, and stood above the specimen.
///
/// Rig and measurements take a specimen to lie flat, so that their reflectances are divided by a cosine of the arms; here they
/// are by that of the true direction, of the light or the sensor as `filling` has it.
pub fn wedge_readings(measurements: &[Measurement], on: &Placement, filling: Filling) -> Vec<WedgeReading> {
    let counts = |m: &&Measurement| m.reading.accepted && !m.shadowed && m.reading.sweep.is_measured();
    let reading = |m: &Measurement| {
        let (incident, exitant) = on.pair(m.pose.light.rad(), m.pose.sensor.rad())?;
        let cosine = match filling {
            Filling::Over => incident.z,
            Filling::Under => exitant.z,
        };
        let flat = filling.arm(m.pose).rad().cos();
        (cosine >= MIN_COSINE).then_some(WedgeReading {
            incident,
            exitant,
            rgb: m.rgb()? * (flat / cosine),
        })
    };
    measurements.iter().filter(counts).filter_map(reading).collect()
}

/// The same from the records of a journal, complete or not.
///
/// # Errors
/// Records without a header, whose file is called the journal then; a rig file or a calibration that this version does not
/// accept.
pub fn readings_on_wedge(records: &[Record], on: &Placement) -> Result<Vec<WedgeReading>, ReportError> {
    let Some(Record::Header(header)) = records.first() else {
        return Err(ReportError::NoHeader {
            path: "the journal".into(),
        });
    };
    let rig = RigFile::parse(&header.rig, "rig file".as_ref()).map_err(ReportError::Rig)?;
    if let Some(certificate) = certificate(records) {
        certificate.check(&rig).map_err(ReportError::Certificate)?;
    }
    let filling = rig.calibration.filling;
    Ok(wedge_readings(&measurements(records, &rig), on, filling))
}
