use super::front::within;
use super::outcome::{ADAPTIVE, Outcome};
use super::summary::Summary;

/// What a study found, in words.
pub(crate) fn words(outcome: &Outcome<'_>, summary: &Summary) -> String {
    let mut text = format!(
        "{} materials of {} families, {} captures on the simulated rig with all its imperfections. Errors are medians over the materials.\n",
        summary.materials,
        families(summary),
        summary.captures
    );
    let own = outcome.own();
    for seconds in [10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0] {
        if let Some(point) = within(&own, seconds) {
            text += &format!(
                "{seconds:4.0} s: MALE {:.5} (10–90 %: {:.5} … {:.5}, mean {:.5}), median relative error {:.2} %: {} of {}\n",
                point.male.median,
                point.male.p10,
                point.male.p90,
                point.male.mean,
                100.0 * point.median_rel.median,
                point.model,
                point.plan()
            );
        }
    }
    for point in &outcome.adaptive {
        let Some(fixed) = within(&own, point.rig_s) else {
            continue;
        };
        text += &format!(
            "{ADAPTIVE}, {:.0} s of {} s: MALE {:.5}, {:.2} times that of the best fixed plan of no more time\n",
            point.rig_s,
            point.budget_s.unwrap_or_default(),
            point.male.median,
            point.male.median / fixed.male.median
        );
    }
    for against in &summary.baselines {
        let word = match against.least_ratio > 1.0 {
            true => "is above the front everywhere from 10 s to 10 min",
            false => "IS NOT ABOVE the front everywhere from 10 s to 10 min",
        };
        text += &format!(
            "{}: {word}; at least {:.2} times its MALE (at {:.0} s)\n",
            against.baseline, against.least_ratio, against.at_s
        );
    }
    for pca in &summary.pca {
        let word = match pca.beaten_from_s {
            Some(seconds) => format!("the front is below it from {seconds:.0} s on"),
            None => "it is below the front at every time".to_owned(),
        };
        text += &format!(
            "log-relative PCA of {} readings {}: MALE {:.5} (10–90 %: {:.5} … {:.5}, mean {:.5}), median relative error {:.2} %; {word}\n",
            pca.readings,
            pca.placed,
            pca.male_median,
            pca.male_p10,
            pca.male_p90,
            pca.male_mean,
            100.0 * pca.median_rel
        );
    }
    text
}

fn families(summary: &Summary) -> usize {
    let mut families: Vec<&str> = summary.families.iter().map(|line| line.family.as_str()).collect();
    families.dedup();
    families.len()
}
