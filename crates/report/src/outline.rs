use brdf::Brdf;
use pdv::{Metrics, Model};
use sweep::{Job, LeftOut};

use crate::derive::Sweeps;
use crate::page::Page;
use crate::run::State;
use crate::{ModelUncertainty, Report, Verdict, figures, preview};

/// What report.html shows of a run.
pub(crate) fn page<'a>(
    report: &'a Report,
    job: &Job,
    sweeps: &Sweeps,
    model: Option<&dyn Model>,
    truth: Option<&dyn Brdf>,
    uncertainty: Option<&ModelUncertainty<'_>>,
) -> Page<'a> {
    let mut pictures = Vec::new();
    let spheres: [(&str, Option<&dyn Brdf>); 2] = [
        ("As reconstructed", model.map(|model| model as &dyn Brdf)),
        ("The simulated specimen itself", model.and(truth)),
    ];
    for (caption, material) in spheres {
        // A picture that cannot be encoded is no reason to have no report.
        let png = material.and_then(|material| preview::sphere(material).png(preview::EXPOSURE).ok());
        pictures.extend(png.map(|png| (caption, png)));
    }
    let mut plots = Vec::new();
    for (plane, observations) in job.planes.iter().zip(&sweeps.planes) {
        plots.push((
            "G: dots towards the normal, rings outwards, lines the model, dashed its 95 % band. Both axes logarithmic.",
            figures::plane(plane.theta_r, observations, model, uncertainty),
        ));
    }
    let of_legs = sweeps.planes.iter().skip(job.planes.len());
    for (index, (leg, observations)) in job.legs.iter().zip(of_legs).enumerate() {
        plots.push((
            "Both arms moved: dots as measured, lines the model, dashed its 95 % band.",
            figures::leg(index, leg, observations, model, uncertainty),
        ));
    }
    if let Some(arc) = &job.arc {
        plots.push((
            "F: the mirror arc, dots as measured, lines the model, dashed its 95 % band.",
            figures::arc(arc.offset, &sweeps.arc, model, uncertainty),
        ));
    }
    let mut tables = Vec::new();
    if let Some(errors) = &report.errors {
        let columns = [
            errors.overall,
            errors.channels.r,
            errors.channels.g,
            errors.channels.b,
        ];
        tables.push(("Errors against the simulated specimen", error_table(&columns)));
    }
    if !report.exports.is_empty() {
        tables.push(("Files in other formats, read back", exports_table(report)));
    }
    let (lost, free): (Vec<_>, Vec<_>) = report.left_out.iter().partition(|left| left.readings > 0);
    if !lost.is_empty() {
        tables.push(("Left out of the plan", left_out_table(&lost)));
    }
    if !free.is_empty() {
        tables.push(("Limits of the arms that cost no reading", free_table(&free)));
    }
    Page {
        title: title(report),
        facts: facts(report),
        pictures,
        checks: &report.checks,
        plots,
        tables,
        notes: notes(report),
    }
}

fn title(report: &Report) -> &str {
    match report.specimen.as_str() {
        "" => "Unnamed specimen",
        specimen => specimen,
    }
}

fn facts(report: &Report) -> Vec<(&'static str, String)> {
    let run = &report.run;
    let state = match (run.state, &run.fault, run.exit_status) {
        (State::Done, _, _) => "done".to_owned(),
        (State::Interrupted, Some(fault), _) => format!("interrupted: {fault}"),
        (State::Interrupted, None, Some(_)) => "interrupted: stopped by the operator".to_owned(),
        (State::Interrupted, None, None) => "interrupted".to_owned(),
    };
    let devices: Vec<String> = run
        .identities
        .iter()
        .map(|device| {
            format!(
                "{} (id {}, firmware {})",
                device.model, device.id, device.firmware
            )
        })
        .collect();
    let verdict = match report.verdict {
        Verdict::Good => "good: no check found anything",
        Verdict::Look => "look: a check below found something that is worth a look",
        Verdict::Bad => "bad: measured, but not usable; the checks below say why",
        Verdict::Unknown => "not judged: the run is not complete",
    };
    let mut facts = vec![
        ("State", state),
        ("Verdict", verdict.to_owned()),
        ("Run", run.id.clone()),
        ("Began", run.started.clone()),
        (
            "Rig time",
            report
                .pace
                .map_or_else(|| format!("{:.1} s", run.seconds.total), |pace| pace.text()),
        ),
        (
            "Readings",
            format!(
                "{} for {} of {} steps",
                run.readings.taken, run.readings.accepted, run.readings.planned
            ),
        ),
        ("Devices", devices.join(", ")),
        ("Program", format!("goniod {}", run.version)),
    ];
    let record = run.record().into_iter();
    facts.extend(record.map(|(_, label, value)| (label, value)));
    let expected = report.adapted.as_ref().and_then(|adapted| adapted.expected_male);
    facts.extend(expected.map(|male| {
        let found = report.errors.and_then(|errors| errors.overall.male);
        let found = found.map(|male| format!("; against the simulated specimen it is {male:.5}"));
        let found = found.unwrap_or_default();
        ("Expected error", format!("MALE {male:.5}{found}"))
    }));
    facts
}

fn notes(report: &Report) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(adapted) = &report.adapted {
        notes.extend(
            adapted
                .added
                .iter()
                .map(|why| format!("Added on the way: {why}.")),
        );
        notes.extend(
            adapted
                .stopped
                .iter()
                .map(|why| format!("Nothing more was measured: {why}.")),
        );
    }
    notes.push(
        "The pictures show a sphere lit by two lamps; each channel c is shown as 1 − exp(−1.57 c) through the sRGB curve. preview.exr holds the values themselves.".to_owned(),
    );
    notes
}

fn error_table(columns: &[Metrics; 4]) -> Vec<Vec<String>> {
    type Pick = fn(&Metrics) -> Option<f64>;
    let rows: [(&str, Pick); 7] = [
        ("MALE", |m| m.male),
        ("median relative error", |m| m.median_rel),
        ("95th percentile of it", |m| m.p95_rel),
        ("relative RMS", |m| m.rel_rms),
        ("log-relative RMSE", |m| m.log_rel_rmse),
        ("Eq. 4", |m| m.eq4),
        ("Eq. 4 of black", |m| m.eq4_black),
    ];
    let head = ["", "all", "red", "green", "blue"].map(str::to_owned).to_vec();
    let mut table = vec![head];
    for (name, pick) in rows {
        let cells = columns
            .iter()
            .map(|m| pick(m).map_or("–".to_owned(), |v| format!("{v:.4}")));
        table.push(std::iter::once(name.to_owned()).chain(cells).collect());
    }
    table
}

fn exports_table(report: &Report) -> Vec<Vec<String>> {
    let head = ["format", "file", "read back"].map(str::to_owned).to_vec();
    let rows = report.exports.iter().map(|export| {
        let file = export.file.clone().unwrap_or_else(|| "refused".to_owned());
        vec![export.format.to_owned(), file, export.text.clone()]
    });
    std::iter::once(head).chain(rows).collect()
}

fn left_out_table(left_out: &[&LeftOut]) -> Vec<Vec<String>> {
    let head = ["what", "readings", "seconds saved", "why"]
        .map(str::to_owned)
        .to_vec();
    let rows = left_out.iter().map(|l| {
        let seconds = format!("{:.1}", l.seconds);
        vec![l.what.clone(), l.readings.to_string(), seconds, l.why.clone()]
    });
    std::iter::once(head).chain(rows).collect()
}

/// Where the arms cannot be, or what they do not do, without that a reading is lost.
fn free_table(left_out: &[&LeftOut]) -> Vec<Vec<String>> {
    let head = ["where", "why"].map(str::to_owned).to_vec();
    let rows = left_out.iter().map(|l| vec![l.what.clone(), l.why.clone()]);
    std::iter::once(head).chain(rows).collect()
}
