use std::sync::Once;

pub(crate) use plotters::chart::SeriesLabelPosition;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::{
    BitMapBackend, Cartesian2d, Circle, DashedLineSeries, DrawingArea, DrawingBackend, FontStyle,
    IntoDrawingArea, IntoLogRange, LineSeries, PathElement, Polygon, RGBColor, SVGBackend, WHITE,
};
use plotters::style::{Color, ShapeStyle, register_font};

use crate::Error;

/// Pixels of a plot.
const SIZE: (u32, u32) = (1000, 640);
const FONT: &str = "sans-serif";
/// Colours that colour-blind people can tell apart (Okabe and Ito 2008, darkened yellow), then greys.
pub(crate) const COLOURS: [[u8; 3]; 9] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [166, 138, 0],
    [86, 180, 233],
    [120, 60, 20],
    [90, 90, 90],
    [0, 0, 0],
];

/// A plot, to be drawn as SVG or PNG.
#[derive(Clone, Debug)]
pub(crate) struct Figure {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// Where the names of the curves stand.
    pub(crate) legend: SeriesLabelPosition,
    pub(crate) curves: Vec<Curve>,
}

/// One axis: what it shows, with its unit, and both ends, above 0 where it is logarithmic.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    pub(crate) label: &'static str,
    pub(crate) log: bool,
    pub(crate) ends: [f64; 2],
}

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    Line,
    Dashed,
    Dots,
}

/// Values that belong together.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// In the legend; none there if empty.
    pub(crate) name: String,
    pub(crate) colour: [u8; 3],
    pub(crate) mark: Mark,
    pub(crate) points: Vec<(f64, f64)>,
    /// x, lower and upper end.
    pub(crate) band: Vec<(f64, f64, f64)>,
}

impl Curve {
    /// A curve without a band.
    pub(crate) fn new(name: &str, colour: [u8; 3], mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            mark,
            points,
            band: Vec::new(),
        }
    }
}

impl Figure {
    /// As SVG.
    ///
    /// # Errors
    /// It cannot be drawn.
    pub(crate) fn svg(&self) -> Result<String, Error> {
        let mut out = String::new();
        self.on(SVGBackend::with_string(&mut out, SIZE).into_drawing_area())?;
        Ok(out)
    }

    /// As PNG.
    ///
    /// # Errors
    /// It cannot be drawn or encoded.
    pub(crate) fn png(&self) -> Result<Vec<u8>, Error> {
        let mut pixels = vec![255; 3 * (SIZE.0 * SIZE.1) as usize];
        self.on(BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area())?;
        Ok(png(SIZE, &pixels)?)
    }

    fn on<B: DrawingBackend>(&self, area: DrawingArea<B, Shift>) -> Result<(), Error> {
        static FONTS: Once = Once::new();
        FONTS.call_once(|| {
            // Fails only for bytes that are no font.
            let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
        });
        let (x, y) = (self.x.ends[0]..self.x.ends[1], self.y.ends[0]..self.y.ends[1]);
        let drawn = match (self.x.log, self.y.log) {
            (true, true) => self.in_axes(&area, x.log_scale(), y.log_scale()),
            (true, false) => self.in_axes(&area, x.log_scale(), y),
            (false, true) => self.in_axes(&area, x, y.log_scale()),
            (false, false) => self.in_axes(&area, x, y),
        };
        drawn
            .and_then(|()| area.present().map_err(|error| error.to_string()))
            .map_err(|why| Error::Plot {
                title: self.title.clone(),
                why,
            })
    }

    fn in_axes<B, X, Y>(&self, area: &DrawingArea<B, Shift>, x: X, y: Y) -> Result<(), String>
    where
        B: DrawingBackend,
        X: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
        Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
        X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let text = |error: plotters::drawing::DrawingAreaErrorKind<B::ErrorType>| error.to_string();
        area.fill(&WHITE).map_err(text)?;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 22))
            .margin(12)
            .x_label_area_size(48)
            .y_label_area_size(78)
            .build_cartesian_2d(x, y)
            .map_err(text)?;
        chart
            .configure_mesh()
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .x_label_formatter(&|v| tick(*v))
            .y_label_formatter(&|v| tick(*v))
            .axis_desc_style((FONT, 17))
            .label_style((FONT, 15))
            .light_line_style(RGBColor(238, 238, 238))
            .bold_line_style(RGBColor(210, 210, 210))
            .draw()
            .map_err(text)?;
        for curve in &self.curves {
            self.draw(&mut chart, curve).map_err(text)?;
        }
        if self.curves.iter().all(|curve| curve.name.is_empty()) {
            return Ok(());
        }
        chart
            .configure_series_labels()
            .position(self.legend.clone())
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font((FONT, 15))
            .draw()
            .map_err(text)
    }

    fn draw<B, X, Y>(
        &self,
        chart: &mut ChartContext<'_, B, Cartesian2d<X, Y>>,
        curve: &Curve,
    ) -> Result<(), plotters::drawing::DrawingAreaErrorKind<B::ErrorType>>
    where
        B: DrawingBackend,
        X: Ranged<ValueType = f64>,
        Y: Ranged<ValueType = f64>,
    {
        let [r, g, b] = curve.colour;
        let colour = RGBColor(r, g, b);
        let shown = |(x, y): (f64, f64)| Some((self.x.hold(x)?, self.y.hold(y)?));
        if curve.band.len() > 1 {
            let lower = curve.band.iter().map(|&(x, low, _)| (x, low));
            let upper = curve.band.iter().rev().map(|&(x, _, high)| (x, high));
            let outline: Vec<_> = lower.chain(upper).filter_map(shown).collect();
            chart.draw_series([Polygon::new(outline, colour.mix(0.15))])?;
        }
        let points: Vec<_> = curve.points.iter().copied().filter_map(shown).collect();
        let style = ShapeStyle::from(&colour).stroke_width(2);
        let drawn = match curve.mark {
            Mark::Line => chart.draw_series(LineSeries::new(points, style))?,
            Mark::Dashed => chart.draw_series(DashedLineSeries::new(points, 7, 5, style))?,
            Mark::Dots => chart.draw_series(
                points
                    .into_iter()
                    .map(|at| Circle::new(at, 2, colour.mix(0.5).filled())),
            )?,
        };
        if !curve.name.is_empty() {
            drawn
                .label(&curve.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        }
        Ok(())
    }
}

impl Axis {
    /// Holds a value within the axis; `None` for what has no place on it.
    fn hold(&self, value: f64) -> Option<f64> {
        value.is_finite().then(|| value.clamp(self.ends[0], self.ends[1]))
    }
}

/// Text of a tick.
fn tick(value: f64) -> String {
    let rounded = (value * 1e9).round() / 1e9;
    match rounded.abs() {
        v if v != 0.0 && !(1e-4..1e5).contains(&v) => format!("{value:.0e}"),
        _ => rounded.to_string(),
    }
}

/// Encodes 8-bit sRGB pixels.
///
/// # Errors
/// None but those of the encoder.
pub(crate) fn png((width, height): (u32, u32), pixels: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(out)
}
