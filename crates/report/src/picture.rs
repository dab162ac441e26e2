use std::fs::File;
use std::io::{self, BufWriter, Write};

use exr::prelude::{
    AttributeValue, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Text, Vec2,
    WritableImage,
};
use glam::DVec3;

/// A linear RGB picture, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// `width` × height pixels, linear RGB.
    pub pixels: Vec<DVec3>,
}

impl Picture {
    /// A picture from a function of (column, row).
    pub fn of(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> DVec3) -> Self {
        let pixels = (0..height)
            .flat_map(|row| (0..width).map(move |column| (column, row)))
            .map(|(column, row)| pixel(column, row))
            .collect();
        Self { width, pixels }
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }

    /// Writes it as OpenEXR with 32-bit float channels R, G, B and text attributes in the header.
    ///
    /// # Errors
    /// The medium refused.
    pub fn write_exr(
        &self,
        file: &mut BufWriter<File>,
        attributes: &[(&str, impl AsRef<str>)],
    ) -> io::Result<()> {
        let mut header = LayerAttributes::default();
        for (name, value) in attributes {
            let text = |text: &str| {
                Text::new_or_none(text).ok_or_else(|| io::Error::other("attribute is not plain text"))
            };
            header
                .other
                .insert(text(name)?, AttributeValue::Text(text(value.as_ref())?));
        }
        let pixel = |at: Vec2<usize>| {
            let rgb = self.pixels[at.y() * self.width + at.x()].as_vec3();
            (rgb.x, rgb.y, rgb.z)
        };
        let layer = Layer::new(
            (self.width, self.height()),
            header,
            // In a fixed order, so that the same picture is the same file.
            Encoding {
                line_order: LineOrder::Increasing,
                ..Encoding::FAST_LOSSLESS
            },
            SpecificChannels::rgb(pixel),
        );
        Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(file)
            .map_err(|error| match error {
                exr::error::Error::Io(error) => error,
                other => io::Error::other(other),
            })
    }

    /// 8-bit sRGB, three bytes a pixel. Tone map: each channel c becomes 1 − exp(−`exposure`·c), then the sRGB transfer
    /// curve.
    pub fn tone_mapped(&self, exposure: f64) -> Vec<u8> {
        let channels = self.pixels.iter().flat_map(DVec3::to_array);
        channels
            .map(|c| (srgb(-(-exposure * c.max(0.0)).exp_m1()) * 255.0).round() as u8)
            .collect()
    }

    /// The picture as an 8-bit sRGB PNG, tone mapped as by [`Picture::tone_mapped`].
    ///
    /// # Errors
    /// None but those of the encoder, which a picture of at least one pixel does not cause.
    pub fn png(&self, exposure: f64) -> io::Result<Vec<u8>> {
        let bytes = self.tone_mapped(exposure);
        let mut out = Vec::new();
        let side = |n: usize| u32::try_from(n).map_err(io::Error::other);
        let mut encoder = png::Encoder::new(&mut out, side(self.width)?, side(self.height())?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&bytes)?;
        writer.finish()?;
        out.flush()?;
        Ok(out)
    }
}

/// sRGB transfer curve (IEC 61966-2-1), 0 … 1 to 0 … 1.
fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    #[test]
    fn exr_keeps_values_and_attributes() {
        let picture = Picture::of(3, 2, |x, y| DVec3::new(x as f64, y as f64, 1.5e4));
        let mut file = BufWriter::new(tempfile::tempfile().unwrap());
        picture.write_exr(&mut file, &[("theta_r_deg", "0 45")]).unwrap();
        use std::io::Seek;
        let mut file = file.into_inner().unwrap();
        file.rewind().unwrap();
        use exr::prelude::{ReadChannels, ReadLayers, read};
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(BufReader::new(file))
            .unwrap();
        let layer = &image.layer_data;
        assert_eq!(
            layer.attributes.other.get(&Text::from("theta_r_deg")),
            Some(&AttributeValue::Text(Text::from("0 45")))
        );
        let channel = |name: &str| -> Vec<f32> {
            let found = layer.channel_data.list.iter().find(|c| c.name.eq(name));
            found.unwrap().sample_data.values_as_f32().collect()
        };
        assert_eq!(channel("R"), [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
        assert_eq!(channel("G"), [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
        assert_eq!(channel("B"), [1.5e4; 6]);
    }

    #[test]
    fn png_maps_black_to_black_and_bright_to_white() {
        let picture = Picture::of(2, 1, |x, _| DVec3::splat(x as f64 * 1e3));
        let png = picture.png(1.0).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, [0, 0, 0, 255, 255, 255]);
    }
}
