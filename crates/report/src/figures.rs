use pdv::{Model, Observation};

use crate::plot::{Axis, Mark, Series, svg};

/// Decades of reflectance that a plot shows at most.
const DECADES: i32 = 6;
/// Points of a model's line.
const LINE: u32 = 200;
const CLASSES: [&str; 3] = ["r", "g", "b"];

/// A plane: reflectance over d_p, both logarithmic; dots towards the normal, rings outwards, lines the model.
pub(crate) fn plane(theta_r: f64, observations: &[Observation], model: Option<&dyn Model>) -> String {
    let of_side = |outwards: bool| {
        let side = observations
            .iter()
            .filter(move |o| (o.deviation < 0.0) == outwards);
        side.map(|o| (o.deviation.abs(), o.rgb.to_array()))
    };
    let x = Axis::around("d_p", Some(5), observations.iter().map(|o| o.deviation.abs()));
    let [low, high] = x.bounds;
    let line = model.into_iter().flat_map(|model| {
        (0..=LINE).filter_map(move |i| {
            let d_p = low * (high / low).powf(f64::from(i) / f64::from(LINE));
            let o = Observation::of(model, theta_r, d_p)?;
            Some((d_p, o.rgb.to_array()))
        })
    });
    let series = [
        series(Mark::Line, line.collect()),
        series(Mark::Dot, of_side(false).collect()),
        series(Mark::Ring, of_side(true).collect()),
    ];
    let title = format!(
        "Plane at {:.1} degrees: reflectance over d_p",
        theta_r.to_degrees()
    );
    draw(&title, &x, &series.concat())
}

/// The arc: reflectance over θ_r, logarithmic; dots as measured, lines the model.
pub(crate) fn arc(offset: f64, observations: &[Observation], model: Option<&dyn Model>) -> String {
    let x = Axis {
        label: "θ_r in degrees",
        log: false,
        bounds: [0.0, 90.0],
    };
    let line = model.into_iter().flat_map(|model| {
        (0..LINE).filter_map(move |i| {
            let theta_r = std::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(LINE);
            let o = Observation::of(model, theta_r, offset)?;
            Some((theta_r.to_degrees(), o.rgb.to_array()))
        })
    });
    let dots = observations
        .iter()
        .map(|o| (o.theta_r.to_degrees(), o.rgb.to_array()));
    let series = [
        series(Mark::Line, line.collect()),
        series(Mark::Dot, dots.collect()),
    ];
    draw("Arc: reflectance over the mirror angle", &x, &series.concat())
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
    let measured = series.iter().filter(|s| s.mark != Mark::Line);
    let values = measured.flat_map(|s| s.points.iter().map(|point| point.1));
    let y = Axis::around("reflectance in 1/sr", Some(DECADES), values);
    svg(title, x, &y, series)
}
