use std::sync::LazyLock;

/// Names of materials, or how they begin, with their families.
const LIST: &str = include_str!("../families.csv");

/// A line of the list.
struct Entry {
    name: String,
    /// Whether a material may go on behind the name.
    begins: bool,
    family: String,
}

static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(LIST.as_bytes());
    let lines = reader.deserialize::<(String, String)>();
    lines
        .map(|line| {
            let (name, family) = line.expect("the list in the program has two columns");
            Entry {
                begins: name.ends_with('*'),
                name: name.trim_end_matches('*').to_owned(),
                family,
            }
        })
        .collect()
});

/// The family of a material by its name; `None` of one that crates/study/families.csv does not list.
pub(crate) fn family(material: &str) -> Option<&'static str> {
    let listed = |entry: &&Entry| match entry.begins {
        true => material.starts_with(&entry.name),
        false => material == entry.name,
    };
    ENTRIES.iter().find(listed).map(|entry| entry.family.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fitted_material_has_a_family_and_none_is_alone_in_it() {
        let families: Vec<&str> = brdf::Fitted::all()
            .map(|(name, _)| family(name).unwrap_or_else(|| panic!("{name} is not listed")))
            .collect();
        for one in &families {
            let members = families.iter().filter(|other| *other == one).count();
            assert!(members > 1 && members < families.len() / 3, "{one}: {members}");
        }
        assert_eq!(family("satin_gold"), Some("satin"));
        assert_eq!(family("something else"), None);
    }
}
