use super::super::{ViewMatch, example};
use super::*;

/// A picture of `size` pixels, as PNG, from a function of the place in [0, 1]² to colour in [0, 1]³.
fn painted(size: [u32; 2], color: impl Fn(f32, f32) -> [f32; 3]) -> Vec<u8> {
    let picture = image::RgbImage::from_fn(size[0], size[1], |x, y| {
        let at = |i: u32, n: u32| (i as f32 + 0.5) / n as f32;
        image::Rgb(color(at(x, size[0]), at(y, size[1])).map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8))
    });
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// A stained-glass pattern.
fn glass(u: f32, v: f32) -> [f32; 3] {
    let (cu, cv) = (u * 7.0 - 3.5, v * 7.0 - 3.5);
    let ring = (cu.hypot(cv) * 2.2).sin() * (cv.atan2(cu) * 6.0).cos();
    let lead = if ring.abs() < 0.08 { 0.05 } else { 1.0 };
    [0.55 + 0.45 * (ring * 2.0).sin(), 0.42 + 0.3 * (ring * 3.0 + 1.0).cos(), 0.6 - 0.4 * ring]
        .map(|c| c * lead)
}

/// A misty interior with shafts of light of a colour.
fn shafts(u: f32, v: f32, light: impl Fn(f32) -> [f32; 3], phase: f32) -> [f32; 3] {
    let across = u + 0.45 * v + phase;
    let shaft = (across * 21.0).sin().max(0.0).powf(1.5) * (1.0 - 0.75 * v) * 0.75;
    let wall = 0.10 + 0.07 * (1.0 - v);
    let colour = light(across);
    [0, 1, 2].map(|c| wall * [1.0, 0.96, 0.9][c] + shaft * colour[c])
}

fn pictures() -> Pictures {
    let size = [640, 360];
    let white = |_: f32| [0.9, 0.88, 0.82];
    let tinted =
        |s: f32| [0.5 + 0.5 * (s * 6.0).sin(), 0.45 + 0.3 * (s * 5.0).cos(), 0.7 - 0.4 * (s * 6.0).sin()];
    let view = |name: &str, phase: f32| ViewPictures {
        name: name.into(),
        target: painted(size, move |u, v| {
            let on_stroke = (v - 0.35 - 0.12 * (u * 5.0 + phase).sin()).abs() < 0.09;
            let grey = shafts(u, v, white, phase).map(|c| c * 0.5);
            if on_stroke { tinted(u + 0.45 * v + phase).map(|c| c * 0.85) } else { grey }
        }),
        before: painted(size, move |u, v| shafts(u, v, white, phase)),
        after: painted(size, move |u, v| shafts(u, v, tinted, phase)),
        difference: painted(size, move |u, v| {
            let (a, b) = (shafts(u, v, white, phase), shafts(u, v, tinted, phase));
            [0, 1, 2].map(|c| (a[c] - b[c]).abs())
        }),
    };
    Pictures {
        frames: Vec::new(),
        turntable: Vec::new(),
        environment: None,
        views: vec![view("front", 0.0), view("aisle", 0.4), view("window", 0.9)],
        found: Some(found(painted([512, 512], glass))),
        coverage: Some(painted([512, 512], |u, v| {
            let strength = (1.0 - 2.2 * (u - 0.5).hypot(v - 0.55)).max(0.0) * (0.8 + 0.2 * (u * 40.0).sin());
            [strength, strength * 0.78, strength * 0.45]
        })),
    }
}

fn found(png: Vec<u8>) -> FoundPicture {
    FoundPicture { title: "The light map", about: "what the light passes through".to_owned(), png }
}

#[test]
fn the_page_is_one_offline_file() {
    let page = html(&example(), &pictures()).unwrap();
    for address in ["http://", "https://", "src=\"//", "url(", "@import", "<link", "<iframe"] {
        assert!(!page.contains(address), "{address}");
    }
    assert_eq!(page.matches("src=\"").count(), page.matches("src=\"data:image/png;base64,iVBOR").count());
    assert_eq!(page.matches("<img ").count(), 2 + 3 * 4);
}

#[test]
fn pictures_are_in_the_page_byte_for_byte() {
    let pictures = pictures();
    let page = html(&example(), &pictures).unwrap();
    let inlined: Vec<Vec<u8>> = page
        .split("data:image/png;base64,")
        .skip(1)
        .map(|rest| STANDARD.decode(rest.split('"').next().unwrap()).unwrap())
        .collect();
    assert_eq!(Some(&inlined[0]), pictures.found.as_ref().map(|found| &found.png));
    assert_eq!(Some(&inlined[1]), pictures.coverage.as_ref());
    assert_eq!(inlined[2], pictures.views[0].target);
    assert_eq!(inlined[13], pictures.views[2].difference);
    assert!(page.contains("width=\"640\" height=\"360\""));
}

#[test]
fn names_cannot_become_markup() {
    let evil = "</title><script>alert('\"&\")</script>";
    let mut report = example();
    let mut pictures = pictures();
    for text in [
        &mut report.scene,
        &mut report.version,
        &mut report.command,
        &mut report.backend,
        &mut report.device,
        &mut report.target,
        &mut report.solver,
        &mut report.strategy.name,
        &mut report.stop.reason,
        &mut report.matched[0].view,
        &mut pictures.views[0].name,
    ] {
        *text = evil.into();
    }
    report.settings.insert(evil.into(), evil.into());
    report.timings.insert(evil.into(), 1.0);
    report.memory.insert(evil.into(), 1);
    report.skipped.insert(evil.into(), super::super::Share { count: 1, of: 2 });
    let page = html(&report, &pictures).unwrap();
    let plain = html(&example(), &self::pictures()).unwrap();
    assert_eq!(page.matches("<script").count(), 1);
    assert_eq!(page.matches("</title>").count(), 1);
    assert!(!page.contains("alert('"));
    assert!(page.matches("&lt;script&gt;alert(&#39;&quot;&amp;&quot;)&lt;/script&gt;").count() >= 15);
    assert_eq!(plain.matches("<script").count(), 1);
}

#[test]
fn the_summary_says_what_happened() {
    let page = html(&example(), &pictures()).unwrap().replace('\u{a0}', " ");
    for words in [
        "3 views, 41,238 painted pixels: the paint is met to 90.1 %",
        "hue is off by 3.1° in the middle and by less than 11.4° in nine of ten pixels",
        "Strokes[3] of view `aisle` lies in shadow: no light reaches any of its 212 pixels.",
        "<em>Paint where light is seen, or take it away.</em>",
        ", in 1.2 s.",
        "after 18 iterations",
        "11.6 M",
        "93.1 MB",
        "0.42 s",
        "2,723,562",
        "<td>98.5 %</td>",
    ] {
        assert!(page.contains(words), "{words}");
    }
}

#[test]
fn the_page_says_what_was_looked_for_in_the_words_of_the_problem() {
    let mut report = Report {
        nouns: Nouns { found: "light".into(), pixel: "wanted pixel".into(), wanted: "target".into() },
        light: None,
        warnings: Vec::new(),
        ..example()
    };
    for elements in [&mut report.problem.elements, &mut report.coverage.elements] {
        *elements = "lights".into();
    }
    let others = ["texel", "voxel", "Texel", "Voxel", "paint", "Paint", "light map", "Light map"];
    let said = |report: &Report| {
        let page = html(report, &Pictures::default()).unwrap();
        let body = &page[page.find("<main>").unwrap()..page.find("<script>").unwrap()];
        others.iter().filter(|&&other| body.contains(other)).count()
    };
    assert_eq!(said(&report), 0);
    assert!(said(&example()) >= 3);
}

#[test]
fn tags_are_balanced() {
    let page = html(&example(), &pictures()).unwrap();
    for tag in
        ["section", "article", "figure", "table", "tbody", "tr", "th", "td", "dl", "dt", "dd", "div", "svg"]
    {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        assert!(opened > 0, "{tag}");
    }
}

#[test]
fn what_is_missing_is_left_out() {
    let pictures = Pictures { found: Some(found(painted([1, 1], |_, _| [1.0; 3]))), ..Pictures::default() };
    let page = html(&Report::default(), &pictures).unwrap();
    for part in ["Convergence", "What was skipped", "Memory", "Hue error", "Views", "NaN", "inf"] {
        assert!(!page.contains(&format!(">{part}")), "{part}");
    }
    let stranger = ViewMatch { view: "elsewhere".into(), ..ViewMatch::default() };
    let report = Report { matched: vec![stranger], ..Report::default() };
    assert!(html(&report, &self::pictures()).is_ok());
}

#[test]
fn broken_pictures_and_numbers_are_refused() {
    let whole = pictures();
    let png = &whole.views[0].target;
    for bytes in [vec![], b"GIF89a".to_vec(), png[..20].to_vec(), png[1..].to_vec()] {
        let mut broken = whole.clone();
        broken.views[1].after = bytes;
        match html(&example(), &broken) {
            Err(Error::Value { path, .. }) => assert_eq!(path, "pictures.views[1].after"),
            other => panic!("{:?}", other.map(|page| page.len())),
        }
    }
    let report = Report { adjoint_error: f64::NAN, ..example() };
    assert!(matches!(html(&report, &whole), Err(Error::NonFinite { .. })));
}

#[test]
#[ignore = "writes a page for a person to look at, into the system's temporary folder"]
fn a_page_to_look_at() {
    let page = html(&example(), &pictures()).unwrap();
    std::fs::write(std::env::temp_dir().join("unscatter-report.html"), page).unwrap();
}
