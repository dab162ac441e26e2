use std::fmt::Write;

/// Width and height of a plot in its own units; the page scales it to the width that it has.
const SIZE: (f64, f64) = (640.0, 400.0);
/// Left, top, right, bottom margin for labels.
const MARGIN: [f64; 4] = [64.0, 14.0, 14.0, 48.0];

/// Room that a logarithmic axis leaves at either end, as a factor.
const MARGIN_LOG: f64 = 1.25;

/// One axis of a plot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    /// What it shows, with its unit.
    pub(crate) label: &'static str,
    /// Logarithmic, in decades; its bounds are then > 0.
    pub(crate) log: bool,
    /// Values at both ends.
    pub(crate) bounds: [f64; 2],
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    /// A polyline.
    Line,
    /// A thin dashed one: an edge of what a line may be.
    Edge,
    /// Filled dots.
    Dot,
    /// Rings.
    Ring,
}

/// Values that belong together.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// CSS class that colours it: r, g, b.
    pub(crate) class: &'static str,
    /// How it is drawn.
    pub(crate) mark: Mark,
    /// (x, y); what is not finite or not within the axes is left out.
    pub(crate) points: Vec<(f64, f64)>,
}

impl Axis {
    /// An axis that holds all values; a logarithmic one spans at least one decade and at most `decades`, from the
    /// top, and values ≤ 0 count for nothing.
    pub(crate) fn around(
        label: &'static str,
        decades: Option<i32>,
        values: impl Iterator<Item = f64>,
    ) -> Self {
        let log = decades.is_some();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|v| v.is_finite() && (!log || *v > 0.0)) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.1, 1.0);
        }
        let bounds = match decades {
            None if low == high => [low - 0.5, high + 0.5],
            None => [low, high],
            Some(decades) => {
                let high = high * MARGIN_LOG;
                let low = (low / MARGIN_LOG).max(high * 10_f64.powi(-decades));
                [low.min(high / 10.0), high]
            }
        };
        Self { label, log, bounds }
    }

    /// Place of a value, 0 … 1; `None` outside.
    fn place(&self, value: f64) -> Option<f64> {
        let scale = |v: f64| if self.log { v.log10() } else { v };
        let [low, high] = self.bounds.map(scale);
        let place = (scale(value) - low) / (high - low);
        (-1e-9..=1.0 + 1e-9).contains(&place).then_some(place)
    }

    /// Values with a label.
    fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.bounds;
        if self.log {
            let steps: &[f64] = if high / low > 300.0 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            return decades
                .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
                .filter(|tick| (low..=high).contains(tick))
                .collect();
        }
        // 1, 2 or 5 times a power of ten, such that there are at most nine.
        let raw = (high - low) / 8.0;
        let decade = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|m| m * decade)
            .into_iter()
            .find(|step| *step >= raw)
            .unwrap_or(raw);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// Text of a tick: plain where it is short, a power of ten elsewhere.
fn tick_text(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        format!("{rounded}")
    } else {
        format!("{value:e}")
    }
}

/// An inline SVG drawing of the series; colours come from the style of the page around it.
pub(crate) fn svg(title: &str, x: &Axis, y: &Axis, series: &[Series]) -> String {
    let (width, height) = SIZE;
    let [left, top, right, bottom] = MARGIN;
    let px = |place: f64| left + place * (width - left - right);
    let py = |place: f64| height - bottom - place * (height - top - bottom);
    let mut out = format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\">\n<title>{title}</title>\n"
    );
    let mut line = |text: std::fmt::Arguments<'_>| {
        out.write_fmt(text).expect("writing to a String does not fail");
        out.push('\n');
    };
    for (tick, place) in x.ticks().into_iter().filter_map(|t| Some((t, x.place(t)?))) {
        let (at, low, high, text) = (px(place), py(0.0), py(1.0), tick_text(tick));
        line(format_args!(
            "<path class=\"grid\" d=\"M{at:.1} {low:.1}V{high:.1}\"/>"
        ));
        line(format_args!(
            "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
            low + 18.0
        ));
    }
    for (tick, place) in y.ticks().into_iter().filter_map(|t| Some((t, y.place(t)?))) {
        let (at, low, high, text) = (py(place), px(0.0), px(1.0), tick_text(tick));
        line(format_args!(
            "<path class=\"grid\" d=\"M{low:.1} {at:.1}H{high:.1}\"/>"
        ));
        line(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
            low - 6.0,
            at + 4.0
        ));
    }
    line(format_args!(
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
        px(0.5),
        height - 8.0,
        x.label
    ));
    line(format_args!(
        "<text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        py(0.5),
        y.label
    ));
    for Series { class, mark, points } in series {
        let placed = points
            .iter()
            .filter_map(|&(vx, vy)| Some(((px(x.place(vx)?), py(y.place(vy)?)), (vx, vy))));
        if matches!(mark, Mark::Line | Mark::Edge) {
            let edge = if *mark == Mark::Edge { " edge" } else { "" };
            let path: Vec<String> = placed.map(|((px, py), _)| format!("{px:.1} {py:.1}")).collect();
            line(format_args!(
                "<polyline class=\"{class}{edge}\" points=\"{}\"/>",
                path.join(" ")
            ));
            continue;
        }
        let ring = if *mark == Mark::Ring { " ring" } else { "" };
        for ((cx, cy), (vx, vy)) in placed {
            line(format_args!(
                "<circle class=\"{class}{ring}\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"2.6\"><title>{vx:.5}, {vy:.4e}</title></circle>"
            ));
        }
    }
    out.push_str("</svg>");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_axis_holds_all_values_that_it_can_show() {
        let axis = Axis::around("f", Some(6), [0.0, f64::NAN, 0.02, 35.0].into_iter());
        assert!(axis.place(0.02).is_some() && axis.place(35.0).is_some());
        assert_eq!(axis.place(0.0), None);
        assert_eq!(axis.ticks(), [0.1, 1.0, 10.0]);
        let narrow = Axis::around("f", Some(6), [0.9, 1.1].into_iter());
        assert!(narrow.ticks().len() >= 2, "{:?}", narrow.ticks());
        let wide = Axis::around("f", Some(2), [1e-9, 1.0].into_iter());
        assert_eq!(wide.place(1e-9), None, "only the upper decades are shown");
    }

    #[test]
    fn axes_without_any_value_still_stand() {
        for decades in [None, Some(6)] {
            let axis = Axis::around("f", decades, std::iter::empty());
            assert!(axis.bounds[0] < axis.bounds[1]);
            assert!(svg("empty", &axis, &axis, &[]).ends_with("</svg>"));
        }
    }

    #[test]
    fn every_finite_point_within_the_axes_is_drawn() {
        let axis = Axis {
            label: "",
            log: false,
            bounds: [0.0, 1.0],
        };
        let points = vec![(0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (f64::NAN, 0.5)];
        let series = Series {
            class: "r",
            mark: Mark::Dot,
            points,
        };
        assert_eq!(svg("", &axis, &axis, &[series]).matches("<circle").count(), 2);
    }
}
