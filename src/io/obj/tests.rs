use std::fs;
use std::path::PathBuf;

use super::materials::GREY;
use super::*;
use crate::scene::{Image, Wrap};

fn of(text: &str) -> Result<(Mesh, Vec<String>)> {
    read(Path::new("/no/such/folder/scene.obj"), text.as_bytes(), usize::MAX)
}

/// Reads a file beside others.
fn beside(text: &str, others: &[(&str, &[u8])]) -> Result<(Mesh, Vec<String>)> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in others {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    read(&folder.path().join("scene.obj"), text.as_bytes(), usize::MAX)
}

fn with_materials(text: &str, materials: &str) -> Mesh {
    beside(text, &[("scene.mtl", materials.as_bytes())]).unwrap().0
}

/// What an error says.
fn fault(text: &str) -> String {
    match of(text) {
        Err(error @ Error::Format { .. }) => error.to_string(),
        other => panic!("{text}: {other:?}"),
    }
}

fn area(mesh: &Mesh) -> f64 {
    let twice = mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|vertex| mesh.positions[vertex as usize]);
        (b - a).cross(c - a).length()
    });
    twice.sum::<f64>() / 2.0
}

/// Triangles that a line along z meets at (x, y), where all of the mesh lies across z.
fn hits(mesh: &Mesh, x: f64, y: f64) -> usize {
    let is_hit = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|vertex| mesh.positions[vertex as usize].truncate());
        let point = glam::DVec2::new(x, y);
        let sides = [[a, b], [b, c], [c, a]].map(|[from, to]| (to - from).perp_dot(point - from));
        sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0)
    };
    mesh.triangles.iter().filter(is_hit).count()
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

const SQUARE: &str = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                      usemtl Leaf\nf 1/1 2/2 3/3 4/4\nusemtl Other\nf -4 -2 -1\n";

#[test]
fn polygons_become_triangles_with_their_materials() {
    let mesh = with_materials(SQUARE, "newmtl Leaf\nKd 0.1 0.8 7.0\nnewmtl Other\nNs 10\n");
    assert_eq!(mesh.triangles.len(), 3);
    let albedo = |triangle: usize| mesh.material(triangle).albedo;
    assert_eq!([albedo(0), albedo(1), albedo(2)], [[0.1, 0.8, 1.0], [0.1, 0.8, 1.0], GREY]);
    let first = mesh.triangles[0].map(|vertex| vertex as usize);
    assert_eq!(first.map(|vertex| mesh.coordinates[vertex]), [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    let last = mesh.triangles[2].map(|vertex| mesh.positions[vertex as usize]);
    assert_eq!(last, [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
}

#[test]
fn triangles_know_their_object_or_group_and_their_material() {
    let text = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
                f 1 2 3\n\
                o Old Tree\nusemtl Leaf\nf 1 2 3\nusemtl Bark #2\nf 1 3 4\n\
                g Wall # of the house\nf 2 3 4\n\
                o Empty\n\
                o Old Tree\nusemtl Leaf\nf 1 2 4\n";
    let mesh = with_materials(text, "newmtl Leaf\nKd 0 1 0\nnewmtl Bark #2\nKd 0.5 0.25 0\n");
    let names =
        |triangle: usize| (mesh.object(triangle).name.as_deref(), mesh.material(triangle).name.as_deref());
    let found: Vec<_> = (0..mesh.triangles.len()).map(names).collect();
    let expected = [
        (None, None),
        (Some("Old Tree"), Some("Leaf")),
        (Some("Old Tree"), Some("Bark #2")),
        (Some("Wall"), Some("Bark #2")),
        (Some("Old Tree"), Some("Leaf")),
    ];
    assert_eq!(found, expected);
    assert_eq!(mesh.objects.len(), 3, "what is named twice is one object, and what is empty is none");
}

#[test]
fn comments_continued_lines_marks_and_line_ends_change_nothing() {
    let plain = of(&format!("{CORNERS}f 1 2 3 4\n")).unwrap().0;
    let marked = format!("\u{feff}{CORNERS}f 1 2 3 4");
    for text in [
        format!("{CORNERS}f 1 2 3 4 # quad\n"),
        format!("{CORNERS}f 1 2 \\\n3 4\n"),
        marked.replace('\n', "\r\n"),
        marked.replace('\n', "\r"),
        "v 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0 # right\nv 0 1 0 x\ns off\nf 1// 2// 3 4/\n".to_owned(),
        format!("{CORNERS}vn 0 0 1\nf 1//1 2//-1 3//1 4//1\n"),
        format!("{CORNERS}f -4 -3 -2 -1\nv 7 7 7\n"),
        // Vertices that no face has are not part of anything.
        format!("{CORNERS}v 9 9 9\np 5\nl 1 5 99999999999\nl 1//6148914691236517206 2//1\nfo 1 2 3 4\n"),
    ] {
        let (mesh, warnings) = of(&text).unwrap();
        assert_eq!((&mesh.positions, &mesh.triangles), (&plain.positions, &plain.triangles), "{text}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    assert!(matches!(read(Path::new("a.obj"), b"\xff\xfev\0", usize::MAX), Err(Error::Format { reason, .. })
        if reason.contains("UTF-16")));
}

#[test]
fn positions_keep_double_precision() {
    let mesh = of("v 500000.11 0 0\nv 500000.89 0 0\nv 500000.89 1 0\nf 1 2 3\n").unwrap().0;
    assert_eq!(mesh.positions[0].x, 500_000.11);
}

#[test]
fn a_wall_keeps_the_window_that_its_outline_runs_around() {
    let corners = "v -4 0 0\nv 4 0 0\nv 4 6 0\nv -4 6 0\nv -1 2 0\nv 1 2 0\nv 1 4 0\nv -1 4 0\n";
    for face in ["f 1 2 3 4 1 5 8 7 6 5", "f 5 6 7 8 5 1 4 3 2 1", "f 8 7 6 5 1 2 3 4 1 5"] {
        let mesh = of(&format!("{corners}{face}\n")).unwrap().0;
        assert_eq!(mesh.triangles.len(), 8);
        assert!((area(&mesh) - 44.0).abs() < 1e-12, "{face}");
        for (x, y, expected) in
            [(0.1, 3.3, 0), (-0.97, 2.04, 0), (3.1, 3.3, 1), (0.1, 1.7, 1), (-2.9, 5.7, 1)]
        {
            assert_eq!(hits(&mesh, x, y), expected, "{face} at {x}, {y}");
        }
    }
}

#[test]
fn concave_polygons_cover_what_they_are_and_no_more() {
    // A dart, an arrow, a comb with corners in line, the same upright and turned round, and a spiral.
    let comb = "0 0  1 0  2 0  3 0  3 2  2 2  2 1  1 1  1 2  0 2  0 1";
    let spiral = "0 0  5 0  5 5  0 5  0 1  4 1  4 4  1 4  1 2  3 2  3 3  2.5 3  2.5 2.5  1.5 2.5  1.5 3.5  3.5 3.5  \
                  3.5 1.5  0.5 1.5  0.5 4.5  4.5 4.5  4.5 0.5  0 0.5";
    for (outline, expected) in [
        ("0 0  2 0  0.5 0.5  0 2", 1.0),
        ("0 0  2 2  1 2  1 4  -1 4  -1 2  -2 2", 8.0),
        (comb, 5.0),
        (spiral, 14.75),
    ] {
        let numbers: Vec<f64> = outline.split_whitespace().map(|number| number.parse().unwrap()).collect();
        let n = numbers.len() / 2;
        let faces = |order: &dyn Fn(usize) -> usize| -> String {
            (0..n).map(|corner| format!(" {}", 1 + order(corner))).collect()
        };
        for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 1, 0)] {
            let vertices: String = numbers
                .chunks(2)
                .map(|p| {
                    let mut position = [0.0; 3];
                    (position[a], position[b], position[c]) = (p[0], p[1], 0.25 * p[0] + 7.0);
                    format!("v {} {} {}\n", position[0], position[1], position[2])
                })
                .collect();
            for first in 0..n {
                for faces in [faces(&|i| (i + first) % n), faces(&|i| (2 * n - 1 - i - first) % n)] {
                    let mesh = of(&format!("{vertices}f{faces}\n")).unwrap().0;
                    let leans = (1.0_f64 + 0.25 * 0.25).sqrt();
                    assert!((area(&mesh) - expected * leans).abs() < 1e-9, "{outline}: {}", area(&mesh));
                    assert_eq!(mesh.triangles.len(), n - 2, "each corner is one of a triangle");
                }
            }
        }
    }
}

#[test]
fn faces_without_an_area_are_counted_and_left_out() {
    let faces = "f 1 2\nf\nf 1 1 2 2 1\nf 1 2 1 2\nf 1 5 2\nf 1 2 3\n";
    let (mesh, warnings) = of(&format!("{CORNERS}v 0.5 0 0\n{faces}")).unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    assert_eq!(warnings, ["faces without an area are left out (5)"]);
    // A polygon may cross itself so that its halves turn against each other.
    assert_eq!(of(&format!("{CORNERS}f 1 3 2 4\n")).unwrap().0.triangles.len(), 2);
}

#[test]
fn polygons_that_take_too_long_are_refused() {
    let n = polygon::MAX_CORNERS + 2;
    let vertices: String =
        (0..n).map(|i| format!("v {i} {} 0\n", if i % 2 == 0 { 0.0 } else { 0.5 })).collect();
    let face: String = (1..=n).map(|i| format!(" {i}")).collect();
    let message = fault(&format!("{vertices}v 0 9 0\nf{face} {}\n", n + 1));
    assert!(
        message.contains(&format!("line {}: a face that is not convex has {} corners", n + 2, n + 1)),
        "{message}"
    );
    // Round ones may have any number.
    let round: String = (0..n)
        .map(|i| (i as f64 / n as f64 * std::f64::consts::TAU).sin_cos())
        .map(|(y, x)| format!("v {x} {y} 0\n"))
        .collect();
    let disc = of(&format!("{round}f{face}\n")).unwrap().0;
    assert!((area(&disc) - std::f64::consts::PI).abs() < 1e-6);
}

#[test]
fn curves_are_left_out_and_lines_are_none() {
    let text = format!("{CORNERS}vp 0.5\ncurv 0 1 1 2 3\nsurf 0 1 0 1 1 2 3 4\nend\nl 1 2 3\nf 1 2 3\n");
    let (mesh, warnings) = of(&text).unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    assert_eq!(warnings, ["curves and free-form surfaces are left out; export them as polygons (2)"]);
    assert!(fault("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n").contains("no triangles"));
}

#[test]
fn a_fault_is_named_with_its_line_and_what_there_is() {
    for (face, expected) in [
        ("f 1 2 5", "line 5: a face has the vertex 5, and there are 4 so far"),
        ("f 1 2 -5", "line 5: a face has the vertex -5, and there are 4 so far"),
        ("f 0 1 2", "line 5: a face has the vertex 0, and there are 4 so far"),
        ("\n\nf 1 \\\n2 x", "line 7: `x` is no number of a vertex"),
        ("f 1 2 99999999999999999999", "line 5: `99999999999999999999` is no number of a vertex"),
        ("f 1 2 -9223372036854775808", "line 5: a face has the vertex -9223372036854775808"),
        ("f 1 2 /1", "line 5: `` is no number of a vertex"),
        ("f 1/1/1/1 2 3", "line 5: `1/1/1/1` is no corner of a face"),
        ("vt 0 0\nf 1/1 2/2 3/3", "line 6: a face has the texture coordinate 2, and there are 1 so far"),
        ("vn 0 0 1\nf 1//9223372036854775807 2//1 3//1", "line 6: a face has the normal 9223372036854775807"),
        ("f 1/0 2/0 3/0", "line 5: a face has the texture coordinate 0"),
        ("v 1 0 nan", "line 5: the vertex `1 0 nan` has a number that is not finite"),
        ("v 1 0 1e999", "line 5: the vertex `1 0 1e999` has a number that is not finite"),
        ("v 1 0 -1e101", "line 5: the vertex `1 0 -1e101` lies beyond 1e100"),
        ("v 1 0", "line 5: the vertex `1 0` is not three numbers"),
        ("v 1 \x1b 0", "line 5: the vertex `1 \u{fffd} 0` is not three numbers"),
    ] {
        let message = fault(&format!("{CORNERS}{face}\nf 1 2 3\n"));
        assert!(message.contains(expected), "{message} for {face:?}");
        assert!(message.starts_with("/no/such/folder/scene.obj is not a usable OBJ file: "), "{message}");
    }
    for text in ["", CORNERS, "v 0 0 0\nv 1 0 0\nf 1 2\n"] {
        assert!(fault(text).contains("it has no triangles"));
    }
    // Coordinates that are not there at all are left out.
    assert!(of(&format!("{CORNERS}f 1/1/1 2/2/2 3/3/3\n")).is_ok());
    assert!(matches!(load(Path::new("/no/such/file.obj"), usize::MAX), Err(Error::File { .. })));
    assert!(matches!(load(&std::env::temp_dir(), usize::MAX), Err(Error::File { .. })));
}

#[test]
fn a_missing_material_file_makes_things_grey() {
    let (mesh, warnings) = of(SQUARE).unwrap();
    assert!((0..3).all(|triangle| mesh.material(triangle).albedo == GREY));
    assert_eq!(warnings, ["the material file `scene.mtl` cannot be read; what it describes is grey"]);
    let (_, warnings) =
        of("mtllib a.mtl b.mtl\nmtllib d.mtl c.mtl a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert!(warnings[0].contains("`a.mtl`, `b.mtl`, `c.mtl` and 1 more"), "{warnings:?}");
}

#[test]
fn material_files_are_found_by_all_their_names() {
    let materials: [(&str, &[u8]); 3] = [
        ("a b.mtl", b"\xef\xbb\xbfnewmtl A\r\nKd 0.25 0.25 0.25\r\n"),
        ("c.mtl", b"newmtl C\rKd 0.5\r"),
        ("sub/d e", b"newmtl D\nKd 0.75 0.75 \\\n0.75 # grey\n"),
    ];
    let faces = "usemtl A\nf 1 2 3\nusemtl C # too\nf 1 2 3\nusemtl D\nf 1 2 3\n";
    for names in ["mtllib a b.mtl c.mtl\nmtllib sub/d e", "mtllib \"a b.mtl\" # one\nmtllib c.mtl sub\\d e"] {
        let (mesh, warnings) = beside(&format!("{names}\n{CORNERS}{faces}"), &materials).unwrap();
        assert_eq!([0, 1, 2].map(|triangle| mesh.material(triangle).albedo[0]), [0.25, 0.5, 0.75], "{names}");
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}

/// The bytes of a PNG whose columns have these brightnesses as sRGB.
fn columns(codes: &[u8]) -> Vec<u8> {
    let linear = codes.iter().map(|&code| [crate::io::image::linear_from_srgb(f32::from(code) / 255.0); 3]);
    crate::io::image::png_bytes(&Image::new([codes.len(), 1], linear.collect()).unwrap(), 0.0).unwrap()
}

#[test]
fn what_is_less_than_opaque_lets_light_through_and_what_is_not_at_all_is_not_there() {
    let of = |material: &str| {
        let mesh = with_materials(SQUARE, &format!("newmtl Leaf\n{material}\n"));
        let glass = mesh.materials[0].glass.as_ref().map(|glass| glass.transmittance);
        (mesh.triangles.len(), glass)
    };
    for (material, count, passes) in [
        ("d 1", 3, None),
        ("d 0.5", 3, Some([0.5; 3])),
        ("Tr 0.75", 3, Some([0.75; 3])),
        ("d 0.01", 3, Some([0.99; 3])),
        ("d 0.99", 3, None),
        ("d 0", 1, None),
        ("Tr 1", 1, None),
        ("Tr 0", 3, None),
        ("d 1\nTr 1", 3, None),
        // A film of the diffuse colour, or what the filter says.
        ("d 0.5\nKd 1 0.5 0", 3, Some([0.5, 0.375, 0.25])),
        ("d 0.5\nKd 1 0.5 0\nTf 0 1 0.5", 3, Some([0.0, 0.5, 0.25])),
        ("d 0.5\nKd 1 0.5 0\nTf 1 1 1", 3, Some([0.5, 0.375, 0.25])),
        ("Tf 0.5", 3, None),
        ("Tf 0.5\nillum 2", 3, None),
        ("Tf 0.5 0.25 1\nillum 4", 3, Some([0.5, 0.25, 1.0])),
        ("Tf 1 1 1\nillum 7", 3, None),
        ("Tf spectral a.rfl\nd 0.5", 3, Some([0.5; 3])),
    ] {
        let (triangles, glass) = of(material);
        assert_eq!(triangles, count, "{material}");
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-6);
        assert!(
            match (glass, passes) {
                (None, None) => true,
                (Some(glass), Some(passes)) => near(glass, passes),
                _ => false,
            },
            "{material}: {glass:?}"
        );
    }
    // What lets all through is nobody's fault.
    let glass = "newmtl Leaf\nd 0\nnewmtl Other\nTr 1\n";
    let (mesh, warnings) = beside(SQUARE, &[("scene.mtl", glass.as_bytes())]).unwrap();
    assert!(mesh.triangles.is_empty() && mesh.positions.is_empty() && mesh.materials.is_empty());
    assert_eq!(warnings, ["faces are transparent and block no light (2)"]);
}

#[test]
fn an_opacity_map_cuts_holes() {
    let (png, materials) = (columns(&[255, 200, 100, 0]), |text: &str| {
        format!("newmtl Leaf\nmap_d {text}leaf 1.png\nnewmtl Other\n")
    });
    let mask_of = |text: &str| {
        let materials = materials(text);
        let files: [(&str, &[u8]); 2] = [("scene.mtl", materials.as_bytes()), ("leaf 1.png", &png)];
        let (mesh, warnings) = beside(SQUARE, &files).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(mesh.material(0).mask, mesh.material(1).mask);
        mesh.material(0).mask.clone().unwrap()
    };
    let mask = mask_of("");
    assert_eq!((mask.size, &mask.alpha[..], mask.cutoff), ([4, 1], &[255, 200, 100, 0][..], 0.5));
    assert_eq!(mask.wrap, [Wrap::Repeat; 2]);
    assert!(mask.is_there([0.3, 0.5]) && !mask.is_there([0.7, 0.5]));
    assert_eq!(mask_of("-clamp on -imfchan l ").wrap, [Wrap::Clamp; 2]);
}

#[test]
fn an_opacity_map_of_glass_says_where_it_is_and_needs_coordinates() {
    let black = columns(&[0; 4]);
    let text = format!("{SQUARE}usemtl Leaf\nf 1 2 3\n");
    let materials = "newmtl Leaf\nd 0.625\nmap_d leaf.png\nnewmtl Other\nmap_d leaf.png\n";
    let files: [(&str, &[u8]); 2] = [("scene.mtl", materials.as_bytes()), ("leaf.png", &black)];
    let mesh = beside(&text, &files).unwrap().0;
    let cutoffs: Vec<_> =
        (0..4).map(|triangle| mesh.material(triangle).mask.as_ref().map(|mask| mask.cutoff)).collect();
    assert_eq!(cutoffs, [Some(0.5), Some(0.5), None, None], "faces without coordinates cannot have holes");
    for material in &mesh.materials {
        assert_eq!(material.glass.is_some(), material.name.as_deref() == Some("Leaf"));
    }
    let white = columns(&[255; 4]);
    let files: [(&str, &[u8]); 2] = [("scene.mtl", materials.as_bytes()), ("leaf.png", &white)];
    assert_eq!(beside(&text, &files).unwrap().0.material(0).mask, None, "without a hole it is no mask");
}

#[test]
fn an_opacity_map_that_is_missing_is_a_warning_and_a_broken_one_an_error() {
    let materials: (&str, &[u8]) = ("scene.mtl", b"newmtl Leaf\nmap_d leaf.png\n");
    let (mesh, warnings) = beside(SQUARE, &[materials]).unwrap();
    assert_eq!(mesh.material(0).mask, None);
    assert!(warnings[0].starts_with("the opacity map `") && warnings[0].contains("leaf.png"), "{warnings:?}");
    assert!(beside(SQUARE, &[materials, ("leaf.png", b"\x89PNG\r\n\x1a\nno")]).is_err());
    // Texture coordinates matter to masks alone.
    let text = SQUARE.replace("vt 0 0\n", "vt nan -\n");
    let unmasked = beside(&text, &[materials]).unwrap().0;
    assert!(
        unmasked.coordinates.iter().flatten().all(|c| c.is_finite()),
        "and those of others are not disturbed"
    );
    assert!(beside(&text, &[materials, ("leaf.png", &columns(&[0; 4]))]).is_err());
}

#[test]
fn the_alpha_of_a_picture_comes_before_its_brightness() {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("leaf.png");
    let pixels =
        image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([255, 255, 255, if x == 0 { 255 } else { 51 }]));
    pixels.save(&path).unwrap();
    assert_eq!(crate::io::image::read_cover(&path).unwrap(), ([2, 1], vec![255, 51]));
}

#[test]
fn damaged_bytes_never_panic() {
    let mut seed = 1_u64;
    for _ in 0..20_000 {
        let mut damaged = SQUARE.as_bytes().to_vec();
        for _ in 0..2 {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let at = (seed >> 33) as usize % damaged.len();
            damaged[at] = b"0123456789-/ \nfv.e\\#"[(seed >> 20) as usize % 20];
        }
        let _ = read(Path::new("/no/such/folder/scene.obj"), &damaged, usize::MAX);
        let _ = mtl::parse(&damaged, Path::new("/no/such/folder"));
    }
}

#[test]
fn triangles_are_counted_before_they_are_too_many() {
    let text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 1 2 3\n";
    assert_eq!(read(Path::new("a.obj"), text, 3).unwrap().0.triangles.len(), 3);
    let error = read(Path::new("a.obj"), text, 2).unwrap_err();
    assert!(matches!(&error, Error::TooLarge { what, .. } if what == "a.obj"), "{error}");
}
