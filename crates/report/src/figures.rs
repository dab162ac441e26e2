use pdv::{Model, Observation, light_angle};

use crate::ModelUncertainty;
use crate::plot::{Axis, Mark, Series, svg};

/// Decades of reflectance that a plot shows at most.
const DECADES: i32 = 6;
/// Points of a model's line.
const LINE: u32 = 200;
const CLASSES: [&str; 3] = ["r", "g", "b"];

/// A plane: reflectance over d_p, both logarithmic; dots towards the normal, rings outwards, lines the model.
pub(crate) fn plane(
    theta_r: f64,
    observations: &[Observation],
    model: Option<&dyn Model>,
    uncertainty: Option<&ModelUncertainty<'_>>,
) -> String {
    let of_side = |outwards: bool| {
        let side = observations
            .iter()
            .filter(move |o| (o.deviation < 0.0) == outwards);
        side.map(|o| (o.deviation.abs(), o.rgb.to_array()))
    };
    let x = Axis::around("d_p", Some(5), observations.iter().map(|o| o.deviation.abs()));
    let [low, high] = x.bounds;
    let along = (0..=LINE).map(|i| {
        let d_p = low * (high / low).powf(f64::from(i) / f64::from(LINE));
        (d_p, theta_r, d_p)
    });
    let [line, below, above] = band(along, model, uncertainty);
    let series = [
        line,
        below,
        above,
        series(Mark::Dot, of_side(false).collect()),
        series(Mark::Ring, of_side(true).collect()),
    ];
    let title = format!(
        "Plane at {:.1} degrees: reflectance over d_p",
        theta_r.to_degrees()
    );
    draw(&title, &x, &series.concat())
}

/// A leg: reflectance over the signed half angle, logarithmic; dots as measured, lines the model along the line that the job
/// asked for, from which arms that wait for each other depart a little.
pub(crate) fn leg(
    index: usize,
    leg: &sweep::Leg,
    observations: &[Observation],
    model: Option<&dyn Model>,
    uncertainty: Option<&ModelUncertainty<'_>>,
) -> String {
    let half_deg = |light: f64, sensor: f64| (light + sensor).to_degrees() / 2.0;
    let ends = leg.half.map(f64::to_degrees);
    let x = Axis {
        label: "half angle in degrees",
        log: false,
        bounds: [ends[0].min(ends[1]), ends[0].max(ends[1])],
    };
    let along = (0..=LINE).map(|i| {
        let pose = leg.pose(f64::from(i) / f64::from(LINE));
        (
            half_deg(pose.light.rad(), pose.sensor.rad()),
            pose.sensor.rad(),
            pose.deviation(),
        )
    });
    let [line, below, above] = band(along, model, uncertainty);
    let dot = |o: &Observation| {
        let light = light_angle(o.theta_r, o.deviation)?;
        Some((half_deg(light, o.theta_r), o.rgb.to_array()))
    };
    let dots = series(Mark::Dot, observations.iter().filter_map(dot).collect());
    let title = format!("Leg {}: reflectance over the half angle", index + 1);
    draw(&title, &x, &[line, below, above, dots].concat())
}

/// The arc: reflectance over θ_r, logarithmic; dots as measured, lines the model.
pub(crate) fn arc(
    offset: f64,
    observations: &[Observation],
    model: Option<&dyn Model>,
    uncertainty: Option<&ModelUncertainty<'_>>,
) -> String {
    let x = Axis {
        label: "θ_r in degrees",
        log: false,
        bounds: [0.0, 90.0],
    };
    let along = (0..LINE).map(|i| {
        let theta_r = std::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(LINE);
        (theta_r.to_degrees(), theta_r, offset)
    });
    let [line, below, above] = band(along, model, uncertainty);
    let dots = observations
        .iter()
        .map(|o| (o.theta_r.to_degrees(), o.rgb.to_array()));
    let series = [line, below, above, series(Mark::Dot, dots.collect())];
    draw("Arc: reflectance over the mirror angle", &x, &series.concat())
}

/// The model along (x of the plot, θ_r, deviation), and the edges of its 95 % band.
fn band(
    along: impl Iterator<Item = (f64, f64, f64)>,
    model: Option<&dyn Model>,
    uncertainty: Option<&ModelUncertainty<'_>>,
) -> [Vec<Series>; 3] {
    let mut lines: [Vec<(f64, [f64; 3])>; 3] = Default::default();
    for (x, theta_r, deviation) in along {
        let Some(o) = model.and_then(|model| Observation::of(model, theta_r, deviation)) else {
            continue;
        };
        lines[0].push((x, o.rgb.to_array()));
        if let Some((uncertainty, (incident, exitant))) = uncertainty.zip(o.pdv().directions()) {
            let factor = uncertainty.u_log(incident, exitant).map(f64::exp);
            lines[1].push((x, (o.rgb / factor).to_array()));
            lines[2].push((x, (o.rgb * factor).to_array()));
        }
    }
    let [line, below, above] = lines;
    [
        series(Mark::Line, line),
        series(Mark::Edge, below),
        series(Mark::Edge, above),
    ]
}

/// One series per channel.
fn series(mark: Mark, points: Vec<(f64, [f64; 3])>) -> Vec<Series> {
    let channels = CLASSES.iter().enumerate();
    channels
        .map(|(channel, class)| Series {
            class,
            mark,
            points: points.iter().map(|(x, rgb)| (*x, rgb[channel])).collect(),
        })
        .collect()
}

fn draw(title: &str, x: &Axis, series: &[Series]) -> String {
    // What was measured decides the range; a model may fall off to nothing.
    let measured = series
        .iter()
        .filter(|s| !matches!(s.mark, Mark::Line | Mark::Edge));
    let values = measured.flat_map(|s| s.points.iter().map(|point| point.1));
    let y = Axis::around("reflectance in 1/sr", Some(DECADES), values);
    svg(title, x, &y, series)
}
