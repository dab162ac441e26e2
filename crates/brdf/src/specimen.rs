use std::path::Path;
use std::sync::Arc;

use crate::{Black, Brdf, Error, Fitted, Lambert, MerlTable, Mirror};

/// The BRDF that a text names: a fitted MERL material (`"alum-bronze"`), `"black"`, `"lambert:0.5"`,
/// `"mirror:0.9"`, or the path of a MERL file (whatever holds a `/` or ends in `.binary`).
///
/// A relative path counts from the working directory. An empty text is an error that lists every material.
///
/// # Errors
/// No such material (near names are suggested), a number that is none or is outside 0 … 1, or a file that is no MERL
/// table.
///
/// ```
/// use brdf::{Brdf, specimen};
/// use glam::DVec3;
///
/// assert_eq!(specimen("black")?.eval(DVec3::Z, DVec3::Z), DVec3::ZERO);
/// assert_eq!(specimen("lambert:0.5")?.eval(DVec3::Z, DVec3::Z).x, 0.5 / std::f64::consts::PI);
/// let Err(error) = specimen("alum-bronse") else { panic!("there is no such material") };
/// assert!(error.to_string().contains("did you mean alum-bronze"));
/// # Ok::<(), brdf::Error>(())
/// ```
pub fn specimen(text: &str) -> Result<Arc<dyn Brdf>, Error> {
    let text = text.trim();
    if text.is_empty() {
        return Err(Error::NoSpecimen {
            names: Fitted::all().map(|(name, _)| name).collect(),
        });
    }
    if text == "black" {
        return Ok(Arc::new(Black));
    }
    let number = |number: &str| {
        number.trim().parse::<f64>().map_err(|_| Error::Number {
            text: text.to_owned(),
            number: number.to_owned(),
        })
    };
    if let Some(albedo) = text.strip_prefix("lambert:") {
        return Ok(Arc::new(Lambert::new(number(albedo)?)?));
    }
    if let Some(reflectance) = text.strip_prefix("mirror:") {
        return Ok(Arc::new(Mirror::new(
            number(reflectance)?,
            Mirror::HALF_ANGLE_RAD,
        )?));
    }
    if text.contains(['/', '\\']) || text.ends_with(".binary") {
        return Ok(Arc::new(MerlTable::read(Path::new(text))?));
    }
    let fitted = Fitted::named(text).ok_or_else(|| unknown(text))?;
    Ok(Arc::new(fitted))
}

fn unknown(name: &str) -> Error {
    let lower = name.to_lowercase();
    let mut near: Vec<(usize, &'static str)> = Fitted::all()
        .map(|(known, _)| {
            (
                if known.contains(&lower) {
                    1
                } else {
                    edits(known, &lower)
                },
                known,
            )
        })
        .filter(|(edits, known)| *edits <= known.len().min(9) / 3)
        .collect();
    near.sort();
    Error::UnknownSpecimen {
        name: name.to_owned(),
        near: near.into_iter().take(3).map(|(_, known)| known).collect(),
    }
}

/// Levenshtein distance in bytes.
fn edits(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.bytes().enumerate() {
            let changed = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn error(text: &str) -> String {
        match specimen(text) {
            Ok(_) => panic!("\"{text}\" was accepted"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn names_materials_and_ideal_specimens() {
        let at = |text: &str| specimen(text).unwrap().eval(DVec3::Z, DVec3::Z).x;
        assert_eq!(at("lambert:0.5"), 0.5 / std::f64::consts::PI);
        assert_eq!(at("black"), 0.0);
        assert!((at("mirror:1") / 4180.0 - 1.0).abs() < 0.01, "{}", at("mirror:1"));
        assert_eq!(
            at(" alum-bronze "),
            Fitted::named("alum-bronze").unwrap().eval(DVec3::Z, DVec3::Z).x
        );
    }

    #[test]
    fn a_misspelt_name_is_met_with_near_ones() {
        let text = error("alum-bronse");
        assert!(
            text.contains("did you mean alum-bronze") && text.contains("lists all 100"),
            "{text}"
        );
        let far = error("qqqqqqqqqqqq");
        assert!(
            !far.contains("did you mean") && far.contains("lists all 100"),
            "{far}"
        );
        let all = error("");
        assert!(Fitted::all().all(|(name, _)| all.contains(name)), "{all}");
    }

    #[test]
    fn numbers_are_checked() {
        assert!(error("lambert:1.5").contains("0 … 1"));
        assert!(error("lambert:NaN").contains("0 … 1"));
        assert!(error("mirror:shiny").contains("\"shiny\" is no number"));
    }

    #[test]
    fn a_path_is_read_as_a_file() {
        let text = error("no/such/file.binary");
        assert!(text.contains("no/such/file.binary"), "{text}");
    }
}
