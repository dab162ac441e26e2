//! What a file of a run is called once it lies among others.

use axum::http::HeaderValue;

use super::keys::encoded;
use crate::RunView;

/// Most characters of a specimen's name in that of a file.
const NAME: usize = 60;
/// Last characters of a run's id that tell it from others of its day.
const TAIL: usize = 6;

/// The name under which a file of a run is saved: specimen, day, end of the run's id, name of the file.
pub(crate) fn download_name(run: &RunView, file: &str) -> String {
    let named = match run.specimen.as_str() {
        "" => run.name.as_str(),
        specimen => specimen,
    };
    let words: Vec<String> = named
        .split(|letter: char| !letter.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect();
    let specimen: String = match words.is_empty() {
        true => "run".to_owned(),
        false => words.join("-").chars().take(NAME).collect(),
    };
    let day = run.started.split('T').next().unwrap_or_default();
    let tail = run.id.len().saturating_sub(TAIL);
    let tail = run.id.get(tail..).unwrap_or(&run.id);
    format!("{specimen}_{day}_{tail}_{file}")
}

/// The header Content-Disposition for a name: the name itself as RFC 8187 writes it, and for whoever does not know that,
/// with an underscore for each letter that is not ASCII.
pub(crate) fn disposition(kind: &str, name: &str) -> HeaderValue {
    let plain: String = name
        .chars()
        .map(|letter| match letter {
            letter if letter.is_ascii_alphanumeric() || "-_.".contains(letter) => letter,
            _ => '_',
        })
        .collect();
    let value = match plain == name {
        true => format!("{kind}; filename=\"{plain}\""),
        false => format!("{kind}; filename=\"{plain}\"; filename*=UTF-8''{}", encoded(name)),
    };
    HeaderValue::from_str(&value).expect("letters of ASCII only")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JobId;

    fn run(specimen: &str) -> RunView {
        RunView {
            id: "01KAGN4Z7Q3X9V5T8R2M6C1D0B".to_owned(),
            place: 1,
            job: JobId::generate(),
            state: crate::JobState::Done,
            record: crate::RecordView::default(),
            archived: None,
            name: "jobs/gold paint.toml".to_owned(),
            specimen: specimen.to_owned(),
            directory: "runs".into(),
            started: "2026-12-01T04:18:18Z".to_owned(),
            reported: None,
            verdict: None,
            planned: 1,
            accepted: 1,
        }
    }

    #[test]
    fn a_download_is_named_for_its_specimen_and_its_day() {
        let name = |specimen: &str| download_name(&run(specimen), "brdf.binary");
        assert_eq!(
            name("Blue paint, no. 3"),
            "Blue-paint-no-3_2026-12-01_6C1D0B_brdf.binary"
        );
        assert_eq!(name("../../etc"), "etc_2026-12-01_6C1D0B_brdf.binary");
        assert_eq!(name(""), "jobs-gold-paint-toml_2026-12-01_6C1D0B_brdf.binary");
        assert_eq!(name("\"\r\n"), "run_2026-12-01_6C1D0B_brdf.binary");
        assert!(name(&"long ".repeat(90)).len() < 100);
    }

    #[test]
    fn a_name_of_any_letters_makes_a_header() {
        assert_eq!(
            disposition("attachment", &download_name(&run("Grün"), "a.csv")),
            "attachment; filename=\"Gr_n_2026-12-01_6C1D0B_a.csv\"; filename*=UTF-8''Gr%C3%BCn_2026-12-01_6C1D0B_a.csv"
        );
        for odd in ["\"", "\r\n", "\u{0}", ";=", "日本", "a b"] {
            disposition("inline", odd);
        }
    }
}
