//! SVG to PNG, with the font that comes with the program: machines without any get the same picture.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Pixels of the PNG for each of the SVG: 192 dots an inch.
const SCALE: f32 = 2.0;

static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    Arc::new(fonts)
});

pub(super) fn png(svg: &str) -> anyhow::Result<Vec<u8>> {
    let options = Options { fontdb: FONTS.clone(), ..Options::default() };
    let tree = Tree::from_str(svg, &options)?;
    let size =
        tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| anyhow::anyhow!("the figure has no size"))?;
    let mut pixels = Pixmap::new(size.width(), size.height())
        .ok_or_else(|| anyhow::anyhow!("no memory for {} by {} pixels", size.width(), size.height()))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    Ok(pixels.encode_png()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dark_pixels(svg: &str) -> usize {
        let pixels = Pixmap::decode_png(&png(svg).unwrap()).unwrap();
        assert_eq!((pixels.width(), pixels.height()), (200, 100));
        pixels.pixels().iter().filter(|pixel| pixel.alpha() > 200 && pixel.red() < 50).count()
    }

    #[test]
    fn text_is_drawn_without_any_font_of_the_machine() {
        let text = |said: &str| {
            format!(
                "<svg xmlns='http://www.w3.org/2000/svg' width='100' height='50'>\
                 <text x='5' y='40' font-family='sans-serif' font-size='30'>{said}</text></svg>"
            )
        };
        assert!(dark_pixels(&text("θ₁ ±5°")) > 300);
        assert_eq!(dark_pixels(&text("")), 0);
    }
}
