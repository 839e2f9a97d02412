use std::path::PathBuf;
use std::sync::OnceLock;

use ::exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image as ExrImage, Layer};
use ::exr::image::{Levels, write::WritableImage};
use ::exr::math::Vec2;
use ::exr::meta::attribute::{Compression, IntegerBounds, LineOrder, Preview};
use ::exr::meta::header::{ImageAttributes, LayerAttributes};
use ::exr::prelude::f16;
use ::image::{DynamicImage, ImageBuffer, ImageFormat};
use proptest::prelude::*;
use tempfile::TempDir;

use super::png_header::tests::png;
use super::*;

/// A folder that is there as long as the test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn holding(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.file(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn picture() -> Image {
    let pixels = (0..35).map(|i| [i as f32 * 0.25, 1.0 / (1.0 + i as f32), -1e-3 * i as f32]).collect();
    Image::new([7, 5], pixels).unwrap()
}

/// Channels of one value each, or of their own values, in one EXR file.
fn exr_bytes(size: [usize; 2], channels: &[(&str, FlatSamples)], encoding: Encoding) -> Vec<u8> {
    placed_exr(size, channels, encoding, [0, 0], IntegerBounds::from_dimensions((size[0], size[1])))
}

fn placed_exr(
    size: [usize; 2],
    channels: &[(&str, FlatSamples)],
    encoding: Encoding,
    position: [i32; 2],
    display: IntegerBounds,
) -> Vec<u8> {
    let list = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone()));
    let attributes = LayerAttributes::default().with_position(Vec2(position[0], position[1]));
    let layer = Layer::new((size[0], size[1]), attributes, encoding, AnyChannels::sort(list.collect()));
    let image = ExrImage::from_layers(ImageAttributes::new(display), vec![layer]);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn constant(value: f32, size: [usize; 2]) -> FlatSamples {
    FlatSamples::F32(vec![value; size[0] * size[1]])
}

fn coded_bytes(image: DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn reason(result: Result<impl std::fmt::Debug>) -> String {
    match result {
        Err(Error::Format { reason, .. }) => reason,
        other => panic!("a format error was expected, not {other:?}"),
    }
}

#[test]
fn an_exr_comes_back_bit_by_bit() {
    let folder = Folder::new();
    let path = folder.file("a.exr");
    for packing in [ExrCompression::None, ExrCompression::Rle, ExrCompression::Zip, ExrCompression::Piz] {
        write_exr_as(&path, &picture(), packing).unwrap();
        assert_eq!(read_image(&path).unwrap(), picture());
        let bytes = std::fs::read(&path).unwrap();
        write_exr_as(&path, &picture(), packing).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), bytes, "the same picture makes the same file");
    }
}

#[test]
fn what_other_programs_may_see_is_plain() {
    let folder = Folder::new();
    let path = folder.file("a.exr");
    write_exr(&path, &picture()).unwrap();
    let meta = ::exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let [header] = meta.headers.as_slice() else { panic!("one part") };
    assert_eq!(names_in(header), ["B", "G", "R"]);
    assert_eq!(header.compression, Compression::RLE);
    assert!(!header.blocks.has_tiles() && header.own_attributes.layer_name.is_none());
}

fn names_in(header: &::exr::meta::header::Header) -> Vec<String> {
    header.channels.list.iter().map(|channel| channel.name.to_string()).collect()
}

#[test]
fn a_png_comes_back_to_half_a_code_and_exposure_doubles_it() {
    let folder = Folder::new();
    let path = folder.file("a.png");
    let grey = Image::new([3, 1], vec![[0.0, 0.25, 0.5], [1.0, 2.0, -1.0], [0.1, 0.2, 0.3]]).unwrap();
    for (exposure, factor) in [(0.0, 1.0), (1.0, 2.0), (-2.0, 0.25)] {
        write_png(&path, &grey, exposure).unwrap();
        let back = read_image(&path).unwrap();
        for (wrote, read) in grey.pixels.iter().flatten().zip(back.pixels.iter().flatten()) {
            let expected = srgb_from_linear((wrote * factor).clamp(0.0, 1.0));
            assert!((srgb_from_linear(*read) - expected).abs() < 0.501 / 255.0);
        }
        assert_eq!(std::fs::read(&path).unwrap(), png_bytes(&grey, exposure).unwrap());
    }
    assert!(matches!(png_bytes(&grey, f64::NAN), Err(Error::Value { .. })));
}

#[test]
fn a_nan_is_never_written_and_named() {
    let folder = Folder::new();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut image = picture();
        image.pixels[9][1] = bad;
        for written in [write_exr(&folder.file("a"), &image), write_png(&folder.file("a"), &image, 0.0)] {
            assert!(matches!(written, Err(Error::NonFinite { place, .. }) if place == "pixel (2, 1)"));
        }
    }
    assert!(!folder.file("a").exists());
}

#[test]
fn pictures_without_pixels_or_with_too_few_are_not_written() {
    let folder = Folder::new();
    let mut short = picture();
    short.pixels.pop();
    assert!(matches!(write_exr(&folder.file("a"), &short), Err(Error::Shape { .. })));
    let empty = Image::constant([0, 4], [0.0; 3]);
    assert!(matches!(write_png(&folder.file("a"), &empty, 0.0), Err(Error::Value { .. })));
}

#[test]
fn a_nan_in_a_picture_that_is_read_is_named() {
    let folder = Folder::new();
    let samples = |bad| FlatSamples::F32((0..4).map(|i| if i == 2 { bad } else { 0.5 }).collect());
    for bad in [f32::NAN, f32::NEG_INFINITY] {
        let channels = [("R", samples(0.0)), ("G", samples(bad)), ("B", samples(0.0))];
        let path = folder.holding("a.exr", &exr_bytes([2, 2], &channels, Encoding::UNCOMPRESSED));
        assert!(reason(read_image(&path)).contains("pixel (0, 1)"));
    }
}

#[test]
fn alpha_is_divided_out_of_an_exr_and_was_never_in_a_png() {
    let folder = Folder::new();
    let size = [2, 2];
    let channels = [0.1, 0.2, 0.05, 0.25].map(|value| constant(value, size));
    let [r, g, b, a] = channels;
    let bytes = exr_bytes(size, &[("R", r), ("G", g), ("B", b), ("A", a)], Encoding::SMALL_LOSSLESS);
    let path = folder.holding("a.exr", &bytes);
    let layer = read_layer(&path, None).unwrap();
    for (got, expected) in layer.pixels[3].iter().zip([0.4, 0.8, 0.2, 0.25]) {
        assert!((got - expected).abs() < 1e-6);
    }
    assert_eq!(read_image(&path).unwrap().pixels[3], [0.1, 0.2, 0.05], "as radiance it is as it is");
    let straight = read_target(&path, Some(Association::Straight)).unwrap();
    assert_eq!(straight.pixels[3], [0.1, 0.2, 0.05, 0.25]);

    let png = ImageBuffer::from_pixel(2, 2, ::image::Rgba([255_u8, 0, 128, 51])).into();
    let layer = read_layer(&folder.holding("a.png", &coded_bytes(png, ImageFormat::Png)), None).unwrap();
    assert_eq!(layer.pixels[0], [1.0, 0.0, linear_from_srgb(128.0 / 255.0), 0.2]);
    let associated = read_layer(&folder.file("a.png"), Some(Association::Associated)).unwrap();
    assert_eq!(associated.pixels[0], [5.0, 0.0, linear_from_srgb(128.0 / 255.0) / 0.2, 0.2]);
    let png = ImageBuffer::from_pixel(2, 2, ::image::Rgba([65535_u16, 0, 1000, 13107])).into();
    let layer = read_layer(&folder.holding("a.png", &coded_bytes(png, ImageFormat::Png)), None).unwrap();
    assert_eq!(layer.pixels[0], [1.0, 0.0, linear_from_srgb(1000.0 / 65535.0), 0.2]);
    let png = ImageBuffer::from_pixel(2, 2, ::image::LumaA([255_u8, 102])).into();
    let layer = read_layer(&folder.holding("a.png", &coded_bytes(png, ImageFormat::Png)), None).unwrap();
    assert_eq!(layer.pixels[0], [1.0, 1.0, 1.0, 0.4]);
}

#[test]
fn a_layer_without_alpha_or_with_an_impossible_one_is_refused() {
    let folder = Folder::new();
    let rgb = || DynamicImage::from(ImageBuffer::from_pixel(2, 2, ::image::Rgb([1_u8, 2, 3])));
    let hdr = DynamicImage::from(rgb().to_rgb32f());
    for (image, format) in [(rgb(), ImageFormat::Png), (rgb(), ImageFormat::Jpeg), (hdr, ImageFormat::Hdr)] {
        let path = folder.holding("a", &coded_bytes(image, format));
        assert!(read_image(&path).is_ok());
        assert!(reason(read_layer(&path, None)).contains("alpha"));
    }
    let size = [2, 2];
    let color = ["R", "G", "B"].map(|name| (name, constant(0.5, size)));
    let path = folder.holding("a", &exr_bytes(size, &color, Encoding::UNCOMPRESSED));
    assert!(reason(read_layer(&path, None)).contains("alpha"));
    for alpha in [-0.02, 1.02, f32::NAN] {
        let mut channels = color.to_vec();
        channels.push(("A", constant(alpha, size)));
        let path = folder.holding("a", &exr_bytes(size, &channels, Encoding::UNCOMPRESSED));
        assert!(reason(read_layer(&path, None)).contains("pixel (0, 0)"), "{alpha}");
    }
}

#[test]
fn alpha_just_outside_its_range_or_too_small_to_divide_by_is_put_right() {
    let folder = Folder::new();
    let size = [2, 2];
    let read = |color: f32, alpha: f32| {
        let mut channels = ["R", "G", "B"].map(|name| (name, constant(color, size))).to_vec();
        channels.push(("A", constant(alpha, size)));
        let bytes = exr_bytes(size, &channels, Encoding::UNCOMPRESSED);
        read_layer(&folder.holding("a", &bytes), None).map(|layer| layer.pixels[0])
    };
    assert_eq!(read(1.0, 0.5).unwrap(), [2.0, 2.0, 2.0, 0.5]);
    assert_eq!(read(1.0005, 1.0005).unwrap(), [1.0; 4]);
    assert_eq!(read(0.5, 1.0 + f32::EPSILON).unwrap()[3], 1.0);
    assert_eq!(read(0.25, -0.005).unwrap(), [0.25, 0.25, 0.25, 0.0]);
    assert_eq!(read(1e20, 1e-30).unwrap(), [0.0; 4], "no colour comes of a division that overflows");
    assert_eq!(read(1e-30, 1e-30).unwrap(), [1.0, 1.0, 1.0, 1e-30]);
    assert!(reason(read(f32::INFINITY, 0.5)).contains("pixel (0, 0) is not a finite number"));
}

#[test]
fn a_png_is_linear_where_it_says_so_to_the_last_bit() {
    let folder = Folder::new();
    let linear = (b"gAMA", &100_000_u32.to_be_bytes()[..]);
    for code in [0, 1, 128, 255_u8] {
        let path = folder.holding("a", &png(8, 0, &[linear], &[code]));
        assert_eq!(read_image(&path).unwrap().pixels[0], [f32::from(code) / 255.0; 3]);
        let path = folder.holding("a", &png(8, 0, &[linear, (b"sRGB", &[0])], &[code]));
        assert_eq!(read_image(&path).unwrap().pixels[0], [linear_from_srgb(f32::from(code) / 255.0); 3]);
    }
    for code in [1000, 65535_u16] {
        let path = folder.holding("a", &png(16, 0, &[linear], &code.to_be_bytes()));
        assert_eq!(read_image(&path).unwrap().pixels[0], [f32::from(code) / 65535.0; 3]);
    }
    let path = folder.holding("a", &png(8, 4, &[linear], &[128, 128]));
    assert_eq!(read_layer(&path, None).unwrap().pixels[0], [128.0 / 255.0; 4], "alpha has no curve");
}

#[test]
fn a_palette_that_panics_the_decoder_is_a_reason() {
    let folder = Folder::new();
    let palette = |data: &[u8]| read_image(&folder.holding("a", &png(8, 3, &[(b"PLTE", data)], &[0])));
    assert_eq!(palette(&[255; 3]).unwrap().pixels[0], [1.0; 3]);
    let deep = png(1, 3, &[(b"PLTE", &[255; 3])], &[0]);
    assert_eq!(read_image(&folder.holding("a", &deep)).unwrap().pixels[0], [1.0; 3]);
    assert!(reason(palette(&[255; 4])).contains("palette"));
    assert!(reason(read_image(&folder.holding("a", &png(8, 3, &[], &[0])))).contains("palette"));
}

/// Hears warnings.
#[derive(Clone, Default)]
struct Listener(std::sync::Arc<std::sync::Mutex<Vec<String>>>);

impl tracing::field::Visit for Listener {
    fn record_debug(&mut self, _: &tracing::field::Field, value: &dyn std::fmt::Debug) {
        self.0.lock().unwrap().push(format!("{value:?}"));
    }
}

impl tracing::Subscriber for Listener {
    fn enabled(&self, metadata: &tracing::Metadata<'_>) -> bool {
        *metadata.level() == tracing::Level::WARN
    }

    fn new_span(&self, _: &tracing::span::Attributes<'_>) -> tracing::span::Id {
        tracing::span::Id::from_u64(1)
    }

    fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}

    fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}

    fn event(&self, event: &tracing::Event<'_>) {
        event.record(&mut self.clone());
    }

    fn enter(&self, _: &tracing::span::Id) {}

    fn exit(&self, _: &tracing::span::Id) {}
}

/// The warnings of reading a picture.
fn warnings(path: &Path) -> Vec<String> {
    let listener = Listener::default();
    tracing::subscriber::with_default(listener.clone(), || read_image(path).unwrap());
    std::mem::take(&mut listener.0.lock().unwrap())
}

#[test]
fn what_a_picture_says_of_its_colours_and_nobody_heeds_is_told_once() {
    let folder = Folder::new();
    let path = folder.holding("a.png", &png(8, 2, &[(b"cICP", &[9, 16, 0, 1])], &[1, 2, 3]));
    let [warning] = &warnings(&path)[..] else { panic!("one warning") };
    assert!(
        ["a.png", "number 9 of ITU-T H.273", "PQ"].iter().all(|part| warning.contains(part)),
        "{warning}"
    );

    let profile = |name: &str| {
        use ::image::ImageEncoder;
        let mut bytes = Vec::new();
        let mut encoder = ::image::codecs::png::PngEncoder::new(&mut bytes);
        encoder.set_icc_profile(name.as_bytes().to_vec()).unwrap();
        encoder.write_image(&[1, 2, 3], 1, 1, ::image::ExtendedColorType::Rgb8).unwrap();
        warnings(&folder.holding("a.png", &bytes))
    };
    assert!(matches!(&profile("Display P3")[..], [warning] if warning.contains("profile")));
    assert!(profile("sRGB IEC61966-2.1").is_empty());

    let channels = ["R", "G", "B"].map(|name| (name, constant(1.0, [1, 1])));
    let wide = |red: (f32, f32)| {
        let list = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone()));
        let layer = Layer::new(
            (1, 1),
            LayerAttributes::default(),
            Encoding::UNCOMPRESSED,
            AnyChannels::sort(list.collect()),
        );
        let mut image = ExrImage::from_layer(layer);
        image.attributes.chromaticities = Some(::exr::meta::attribute::Chromaticities {
            red: Vec2(red.0, red.1),
            green: Vec2(0.3, 0.6),
            blue: Vec2(0.15, 0.06),
            white: Vec2(0.3127, 0.329),
        });
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        warnings(&folder.holding("a.exr", bytes.get_ref()))
    };
    assert!(wide((0.64, 0.33)).is_empty());
    assert!(matches!(&wide((0.708, 0.292))[..], [warning] if warning.contains("chromaticities")));
}

#[test]
fn exr_files_of_other_programs_are_read() {
    let folder = Folder::new();
    let size = [70, 40];
    let ramp: Vec<f32> = (0..70 * 40).map(|i| i as f32 / 64.0).collect();
    let float = FlatSamples::F32(ramp.clone());
    let half = FlatSamples::F16(ramp.iter().map(|&value| f16::from_f32(value / 4.0)).collect());
    let encodings = [Compression::RLE, Compression::PIZ, Compression::ZIP1, Compression::Uncompressed];
    for compression in encodings {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 16))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            for names in [["R", "G", "B", "A"], ["ink.R", "ink.G", "ink.B", "ink.A"]] {
                let channels = [
                    (names[0], float.clone()),
                    (names[1], half.clone()),
                    (names[2], constant(2.0, size)),
                    (names[3], constant(1.0, size)),
                ];
                let path = folder.holding("a", &exr_bytes(size, &channels, encoding));
                let expected = |i: usize| [ramp[i], f16::from_f32(ramp[i] / 4.0).to_f32(), 2.0];
                for i in [0, 71, 2799] {
                    assert_eq!(read_image(&path).unwrap().pixels[i], expected(i));
                    assert_eq!(read_layer(&path, None).unwrap().pixels[i][..3], expected(i));
                }
            }
        }
    }
    let grey = folder.holding("a", &exr_bytes(size, &[("Y", float)], Encoding::FAST_LOSSLESS));
    assert_eq!(read_image(&grey).unwrap().pixels[99], [ramp[99]; 3]);
}

/// Two pictures of 40 × 24 pixels: white, and twice as bright.
fn two_parts() -> Vec<u8> {
    let part = |name: &str, value: f32| {
        let list = ["R", "G", "B"].map(|channel| AnyChannel::new(channel, constant(value, [40, 24])));
        let channels = AnyChannels::sort(list.into_iter().collect());
        Layer::new((40, 24), LayerAttributes::named(name), Encoding::FAST_LOSSLESS, channels)
    };
    let display = ImageAttributes::with_size((40, 24));
    let image = ExrImage::from_layers(display, vec![part("front", 1.0), part("back", 2.0)]);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// A white picture of 40 × 24 pixels whose smaller levels are brighter, with a small preview.
fn mip_mapped() -> Vec<u8> {
    let levels = || Levels::Mip {
        rounding_mode: ::exr::math::RoundingMode::Down,
        level_data: [(40, 24), (20, 12), (10, 6), (5, 3), (2, 1), (1, 1)]
            .iter()
            .enumerate()
            .map(|(level, (w, h))| FlatSamples::F32(vec![1.0 + level as f32; w * h]))
            .collect(),
    };
    let list = ["R", "G", "B"].map(|channel| AnyChannel::new(channel, levels()));
    let encoding = Encoding { blocks: Blocks::Tiles(Vec2(16, 16)), ..Encoding::SMALL_FAST_LOSSLESS };
    let preview = Preview { size: Vec2(2, 1), pixel_data: vec![7; 8] };
    let attributes = LayerAttributes { preview: Some(preview), ..LayerAttributes::default() };
    let layer = Layer::new((40, 24), attributes, encoding, AnyChannels::sort(list.into_iter().collect()));
    let mut bytes = std::io::Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn mip_maps_and_second_layers_do_not_disturb() {
    let folder = Folder::new();
    for bytes in [two_parts(), mip_mapped()] {
        let read = read_image(&folder.holding("a", &bytes)).unwrap();
        assert_eq!(read, Image::constant([40, 24], [1.0; 3]));
    }
}

/// A block that names another place leaves its own open, though the number of blocks is right.
#[test]
fn a_picture_with_a_block_missing_is_refused() {
    let folder = Folder::new();
    let intact = mip_mapped();
    // The table of the 12 blocks ends where the first block begins.
    let table = 12 * 8;
    let offset_at = |at: usize| u64::from_le_bytes(intact[at..at + 8].try_into().unwrap());
    let first = (0..intact.len() - 8).find(|&at| offset_at(at) == (at + table) as u64).unwrap() + table;
    for (tile, level, expected) in [(0_i32, 1_i32, "missing"), (1, 0, "twice")] {
        let mut bytes = intact.clone();
        bytes[first..first + 4].copy_from_slice(&tile.to_le_bytes());
        bytes[first + 8..first + 16].copy_from_slice(&[level.to_le_bytes(); 2].concat());
        assert!(reason(read_image(&folder.holding("a", &bytes))).contains(expected), "{expected}");
    }
}

#[test]
fn files_that_leave_it_open_which_picture_is_meant_are_refused() {
    let folder = Folder::new();
    let size = [4, 4];
    let names =
        ["sky.R", "sky.G", "sky.B", "ink.R", "ink.G", "ink.B"].map(|name| (name, constant(1.0, size)));
    let path = folder.holding("a", &exr_bytes(size, &names, Encoding::FAST_LOSSLESS));
    let reason_of_two = reason(read_image(&path));
    assert!(reason_of_two.contains("sky") && reason_of_two.contains("ink"));
    let depth = folder.holding("a", &exr_bytes(size, &[("Z", constant(1.0, size))], Encoding::FAST_LOSSLESS));
    assert!(reason(read_image(&depth)).contains("only Z"));
}

#[test]
fn the_compression_whose_decoder_is_not_safe_is_refused() {
    let encoding = Encoding { compression: Compression::DWAA(None), ..Encoding::FAST_LOSSLESS };
    let bytes = exr_bytes([4, 4], &[("Y", constant(1.0, [4, 4]))], encoding);
    assert!(reason(read_image(&Folder::new().holding("a", &bytes))).contains("save it with ZIP"));
}

#[test]
fn the_data_window_is_put_in_its_place() {
    let folder = Folder::new();
    let size = [3, 3];
    let ramp = FlatSamples::F32((0..9).map(|i| i as f32).collect());
    let channels = [("R", ramp.clone()), ("G", ramp.clone()), ("B", ramp), ("A", constant(1.0, size))];
    let display = IntegerBounds::new((10, 20), (4, 5));
    let bytes = placed_exr(size, &channels, Encoding::UNCOMPRESSED, [9, 23], display);
    let layer = read_layer(&folder.holding("a", &bytes), None).unwrap();
    assert_eq!(layer.size(), [4, 5]);
    let weights: Vec<f32> = layer.pixels.iter().map(|p| p[3]).collect();
    let mut expected = [0.0; 20];
    for index in [12, 13, 16, 17] {
        expected[index] = 1.0;
    }
    assert_eq!(weights, expected);
    assert_eq!(layer.pixels[12], [1.0, 1.0, 1.0, 1.0]);
}

#[test]
fn what_the_data_window_leaves_open_has_no_weight() {
    let folder = Folder::new();
    let channels = ["R", "G", "B"].map(|name| (name, constant(0.5, [2, 1])));
    let display = IntegerBounds::new((0, 0), (4, 2));
    let bytes = placed_exr([2, 1], &channels, Encoding::UNCOMPRESSED, [1, 1], display);
    let target = read_target(&folder.holding("a", &bytes), None).unwrap();
    let open = [0.0; 4];
    let there = [0.5, 0.5, 0.5, 1.0];
    assert_eq!(target.pixels, [open, open, open, open, open, there, there, open]);
}

#[test]
fn a_block_that_would_take_all_memory_is_refused() {
    let folder = Folder::new();
    let encoding = Encoding { blocks: Blocks::Tiles(Vec2(2, 2)), ..Encoding::UNCOMPRESSED };
    let mut exr = exr_bytes([2, 2], &[("Y", constant(1.0, [2, 2]))], encoding);
    let value_of = |attribute: &[u8]| {
        exr.windows(attribute.len()).position(|w| w == attribute).unwrap() + attribute.len() + 4
    };
    let (window, tiles) = (value_of(b"dataWindow\0box2i\0") + 8, value_of(b"tiles\0tiledesc\0"));
    for (at, value) in [(window, 16383_i32), (window + 4, 16383), (tiles, 16384), (tiles + 4, 16384)] {
        exr[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    exr.resize(1 << 17, 0);
    assert!(reason(read_image(&folder.holding("a", &exr))).contains("blocks of 16384 × 16384"));
}

/// A block that is not shown may be damaged: nobody has looked.
#[test]
fn only_blocks_that_are_shown_are_unpacked() {
    let folder = Folder::new();
    let size = [64, 64];
    let noise = (0..64 * 64_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32).collect();
    let noise = FlatSamples::F32(noise);
    let channels = ["R", "G", "B"].map(|name| (name, noise.clone()));
    for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 16))] {
        let encoding = Encoding { compression: Compression::ZIP1, blocks, line_order: LineOrder::Increasing };
        let display = IntegerBounds::new((-20, -20), (30, 30));
        let mut bytes = placed_exr(size, &channels, encoding, [0, 0], display);
        let end = bytes.len() - 40;
        bytes[end..].fill(0xff);
        assert!(read_image(&folder.holding("a", &bytes)).is_ok());
        let display = IntegerBounds::new((0, 0), (64, 64));
        let mut bytes = placed_exr(size, &channels, encoding, [0, 0], display);
        let end = bytes.len() - 40;
        bytes[end..].fill(0xff);
        assert!(read_image(&folder.holding("a", &bytes)).is_err());
    }
}

#[test]
fn the_size_of_a_picture_is_read_from_its_header() {
    let folder = Folder::new();
    for (kind, file) in valid_files().iter().enumerate() {
        let path = folder.holding("whole", file);
        assert_eq!(size_of(&path).unwrap(), read_image(&path).unwrap().size(), "kind {kind}");
    }
    for format in [ImageFormat::Png, ImageFormat::Hdr] {
        let picture = DynamicImage::new_rgb32f(300, 200);
        let picture = if format == ImageFormat::Png { picture.to_rgb8().into() } else { picture };
        let bytes = coded_bytes(picture, format);
        let path = folder.holding("half", &bytes[..bytes.len() - 16]);
        assert_eq!(size_of(&path).unwrap(), [300, 200], "{format:?}");
        assert!(read_image(&path).is_err(), "{format:?}");
    }
    let exr = exr_bytes([300, 200], &[("Y", constant(1.0, [300, 200]))], Encoding::UNCOMPRESSED);
    assert_eq!(size_of(&folder.holding("half", &exr[..exr.len() / 2])).unwrap(), [300, 200]);
    assert!(reason(size_of(&folder.holding("other", b"GIF89a"))).contains("EXR, PNG, HDR or JPEG"));
}

#[test]
fn other_files_are_refused_with_a_reason() {
    let folder = Folder::new();
    assert!(reason(read_image(&folder.holding("a.png", b"GIF89a"))).contains("EXR, PNG, HDR or JPEG"));
    assert!(reason(read_image(&folder.holding("empty.exr", b""))).contains("EXR, PNG, HDR or JPEG"));
    assert!(matches!(read_image(&folder.file("missing")), Err(Error::File { action: "read", .. })));
    assert!(matches!(read_image(folder.0.path()), Err(Error::File { action: "read", .. })));
}

#[test]
fn a_header_without_a_body_is_refused_before_anything_is_allocated() {
    let folder = Folder::new();
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n";
    assert!(reason(read_image(&folder.holding("a", hdr))).contains("too few"));
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000000000 +X 4000000000\n";
    assert!(read_image(&folder.holding("a", hdr)).is_err());
    let mut exr = exr_bytes([2, 2], &[("Y", constant(1.0, [2, 2]))], Encoding::UNCOMPRESSED);
    let value_of = |attribute: &[u8]| {
        exr.windows(attribute.len()).position(|w| w == attribute).unwrap() + attribute.len() + 4
    };
    let (window, count) = (value_of(b"dataWindow\0box2i\0") + 8, value_of(b"chunkCount\0int\0"));
    for (side, expected) in [(12_000_i32, "too few"), (20_000, "16384"), (2_000_000_000, "")] {
        for (at, value) in [(window, side - 1), (window + 4, side - 1), (count, side)] {
            exr[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        assert!(reason(read_image(&folder.holding("a", &exr))).contains(expected), "{side}");
    }
}

/// Small files of every format and compression that the readers take.
fn valid_files() -> &'static [Vec<u8>] {
    static FILES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    FILES.get_or_init(make_files)
}

fn make_files() -> Vec<Vec<u8>> {
    let size = [21, 19];
    let ramp = FlatSamples::F32((0..21 * 19).map(|i| (i % 23) as f32 / 7.0).collect());
    let channels = [("R", ramp.clone()), ("G", ramp.clone()), ("B", ramp), ("A", constant(0.5, size))];
    use Compression::{B44, PIZ, PXR24, RLE, ZIP1, ZIP16};
    let mut files = Vec::new();
    for compression in [Compression::Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 8))] {
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            files.push(exr_bytes(size, &channels, encoding));
        }
    }
    let rgba = ImageBuffer::from_fn(21, 19, |x, y| ::image::Rgba([x as u8, (x * y) as u8, 200, y as u8]));
    let rgba = DynamicImage::from(rgba);
    files.push(coded_bytes(rgba.clone(), ImageFormat::Png));
    files.push(coded_bytes(rgba.to_rgba16().into(), ImageFormat::Png));
    files.push(coded_bytes(rgba.to_rgb8().into(), ImageFormat::Jpeg));
    files.push(coded_bytes(rgba.to_rgb32f().into(), ImageFormat::Hdr));
    files.extend([two_parts(), mip_mapped()]);
    files
}

/// Reads whatever this is; the answer may be a picture or an error, but nothing else.
fn survive(folder: &Folder, bytes: &[u8]) {
    let path = folder.holding("damaged", bytes);
    for error in [read_image(&path).err(), read_layer(&path, None).err()].into_iter().flatten() {
        assert!(matches!(error, Error::Format { .. }), "{error}");
    }
}

#[test]
fn every_file_cut_short_is_an_error_or_has_only_lost_padding() {
    let folder = Folder::new();
    for (kind, file) in valid_files().iter().enumerate() {
        assert!(read_image(&folder.holding("whole", file)).is_ok(), "kind {kind}");
        for length in (0..file.len()).step_by(1 + file.len() / 200) {
            survive(&folder, &file[..length]);
        }
        assert!(
            reason(read_image(&folder.holding("half", &file[..file.len() / 2]))).len() > 5,
            "kind {kind}"
        );
    }
}

/// Random bytes seldom make a size that is just too large, so these are put everywhere.
#[test]
fn extreme_numbers_anywhere_in_a_header_never_panic() {
    let folder = Folder::new();
    let files = valid_files();
    for file in files[..2].iter().chain(&files[16..]) {
        let is_exr = PictureFormat::of(file) == Some(PictureFormat::Exr);
        for at in 0..file.len().min(600) - 4 {
            for value in [-1, i32::MAX, 1 << 28] {
                let mut file = file.clone();
                file[at..at + 4].copy_from_slice(&if is_exr {
                    value.to_le_bytes()
                } else {
                    value.to_be_bytes()
                });
                survive(&folder, &file);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn damaged_files_never_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        headwards in any::<bool>(),
    ) {
        let folder = Folder::new();
        for mut file in valid_files().iter().cloned() {
            // The headers are small beside the pixels, and the more interesting part to damage.
            let reach = if headwards { file.len().min(400) } else { file.len() };
            for (index, value) in &damage {
                file[index.index(reach)] = *value;
            }
            survive(&folder, &file);
        }
    }
}
