//! Files as other programs write them.

use super::*;

#[test]
fn arrays_of_every_kind_are_read() {
    let numbers = [0.5_f32, -3.25, 2.0];
    let little = |of: fn(f32) -> Vec<u8>| numbers.map(of).concat();
    let big = |of: fn(f32) -> Vec<u8>| numbers.map(|n| of(n).into_iter().rev().collect::<Vec<_>>()).concat();
    let half = |n: f32| f16::from_f32(n).to_le_bytes().to_vec();
    let single = |n: f32| n.to_le_bytes().to_vec();
    let double = |n: f32| f64::from(n).to_le_bytes().to_vec();
    for (dtype, values) in [
        ("<f2", little(half)),
        (">f2", big(half)),
        ("<f4", little(single)),
        (">f4", big(single)),
        ("<f8", little(double)),
        (">f8", big(double)),
    ] {
        let Stored { volume, placed, .. } =
            read_bytes(Format::Npy, &npy(dtype, "False", "(1, 1, 3)", &values)).unwrap();
        assert_eq!((volume.grid(), volume.channels(), placed), (&grid([3, 1, 1]), 1, false));
        assert_eq!(volume.samples().iter().collect::<Vec<_>>(), numbers);
        assert_eq!(matches!(volume.samples(), Samples::F16(_)), dtype.ends_with("f2"));
        let colored = read_bytes(Format::Npy, &npy(dtype, "False", "(1, 1, 1, 3)", &values)).unwrap();
        assert_eq!(colored.volume.color(0), numbers);
    }
    let bytes = read_bytes(Format::Npy, &npy("|u1", "False", "(2, 1, 1, 1)", &[7, 255])).unwrap().volume;
    assert_eq!((bytes.grid().size(), bytes.samples()), ([1, 1, 2], &Samples::F32(vec![7.0, 255.0])));
}

#[test]
fn arrays_of_whole_numbers_and_in_fortran_order_are_volumes_in_and_outside_of_archives() {
    let volume = counting([4, 3, 2], 3);
    let shape = "(2, 3, 4, 3)";
    let c_order: Vec<u8> = (0..72_i16).flat_map(i16::to_be_bytes).collect();
    // Number n of the file stands at z = n mod 2, y = n / 2 mod 3 and so on.
    let at = |n: i16| ((n % 2 * 3 + n / 2 % 3) * 4 + n / 6 % 4) * 3 + n / 24;
    let fortran: Vec<u8> = (0..72).flat_map(|n| at(n).to_be_bytes()).collect();
    for (order, values) in [("False", c_order), ("True", fortran)] {
        let array = npy(">i2", order, shape, &values);
        assert_eq!(read_bytes(Format::Npy, &array).unwrap().volume, volume, "{order}");
        let archive = archive(&[("a.npy", array)], CompressionMethod::Deflated);
        assert_eq!(read_bytes(Format::Npz, &archive).unwrap().volume, volume, "{order}");
    }
    let place = [[2.0_f64, 0.0, 0.0, 5.0], [0.0, 3.0, 0.0, 6.0], [0.0, 0.0, 4.0, 7.0], [0.0, 0.0, 0.0, 1.0]];
    let columns = |column: usize| place.map(|row| row[column].to_le_bytes()).concat();
    let place = npy("<f8", "True", "(4, 4)", &(0..4).flat_map(columns).collect::<Vec<_>>());
    let members = [("world_from_grid.npy", place), ("a.npy", of_value(1.0))];
    let found = read_bytes(Format::Npz, &archive(&members, CompressionMethod::Stored)).unwrap().volume;
    assert_eq!(found.grid().world_from_grid().transform_point3(DVec3::ONE), DVec3::new(7.0, 9.0, 11.0));
}

#[test]
fn memory_is_asked_for_before_values_are_read() {
    let values = [0; 48];
    let array = |dtype, order| npy(dtype, order, "(2, 2, 3)", &values);
    let asked = |format: Format, bytes: &[u8]| {
        let (_folder, path) = folder_for(format);
        std::fs::write(&path, bytes).unwrap();
        let asked = std::cell::Cell::new(0);
        let refused = read_within(&path, None, &|bytes| {
            asked.set(bytes);
            Err(Error::Interrupted)
        });
        assert!(matches!(refused, Err(Error::Interrupted)), "{format:?}");
        asked.get()
    };
    assert_eq!(asked(Format::Npy, &array("<f4", "False")), 48);
    assert_eq!(asked(Format::Npy, &array("<i2", "False")), 48);
    assert_eq!(asked(Format::Npy, &array("<f2", "False")), 24);
    assert_eq!(asked(Format::Npy, &array("<f4", "True")), 96);
    let archive = archive(&[("a.npy", array("<f4", "False"))], CompressionMethod::Deflated);
    assert_eq!(asked(Format::Npz, &archive), 48);
    assert_eq!(asked(Format::Vol, &vol(1, [3, 2, 2], 1, &values)), 48);
    assert_eq!(asked(Format::Vol, &vol(3, [3, 4, 4], 1, &values)), 192);
}

#[test]
fn arrays_that_are_no_volume_are_refused() {
    let told = |dtype, order, shape, length| {
        reason(read_bytes(Format::Npy, &npy(dtype, order, shape, &vec![0; length])))
    };
    assert!(told("<f4", "False", "(4, 4)", 64).contains("(z, y, x)"));
    assert!(told("<f4", "False", "(1, 1, 1, 2)", 8).contains("2 channels"));
    assert!(told("<f4", "False", "(0, 4, 4)", 64).contains("sides go from 1"));
    assert!(told("|u1", "False", "(1, 1, 4097)", 4097).contains("sides go from 1"));
    assert!(told("<c8", "False", "(2, 2, 2)", 64).contains("astype"));
    assert!(told("<f4", "False", "(2, 2, 2)", 31).contains("too few"));
    let mut values = [1.0_f32; 12];
    values[7] = f32::NAN;
    let bytes = npy("<f4", "False", "(2, 2, 1, 3)", &values.map(f32::to_le_bytes).concat());
    assert!(reason(read_bytes(Format::Npy, &bytes)).contains("voxel (0, 0, 1)"));
    let beyond = npy("<f8", "False", "(1, 1, 1)", &1e300_f64.to_le_bytes());
    assert!(reason(read_bytes(Format::Npy, &beyond)).contains("voxel (0, 0, 0)"));
}

#[test]
fn members_are_chosen_by_name() {
    let (_folder, path) = folder_for(Format::Npz);
    let value = |member| read(&path, member).map(|stored| stored.volume.samples().get(0));
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let members =
            [("a.npy", of_value(1.0)), ("../../b.npy", of_value(2.0)), ("readme.txt", b"text".to_vec())];
        std::fs::write(&path, archive(&members, method)).unwrap();
        assert_eq!(value(Some("a")).unwrap(), 1.0);
        assert_eq!(value(Some("../../b.npy")).unwrap(), 2.0, "a name, and no path");
        let told = value(None).unwrap_err().to_string();
        assert!(told.contains("`a`, `../../b`") && !told.contains("readme"), "{told}");
        let told = value(Some("c")).unwrap_err().to_string();
        assert!(told.contains("`c`") && told.contains("`a`, `../../b`"), "{told}");
        std::fs::write(&path, archive(&members[1..], method)).unwrap();
        assert_eq!(value(None).unwrap(), 2.0);
    }
    std::fs::write(&path, archive(&[("readme.txt", vec![])], CompressionMethod::Stored)).unwrap();
    assert!(value(None).unwrap_err().to_string().contains("it has none"));
    let many: Vec<_> = (0..100).map(|index| format!("{index}\u{1b}[2J{}.npy", "x".repeat(1000))).collect();
    let many: Vec<_> = many.iter().map(|name| (name.as_str(), of_value(0.0))).collect();
    std::fs::write(&path, archive(&many, CompressionMethod::Stored)).unwrap();
    let told = value(None).unwrap_err().to_string();
    assert!(told.contains("84 more") && told.len() < 2000 && !told.contains('\u{1b}'), "{told}");
}

#[test]
fn the_place_in_an_archive_is_heeded_or_refused() {
    let place = |dtype, shape, numbers: &[f64]| {
        let bytes: Vec<u8> = match dtype {
            "<f4" => numbers.iter().flat_map(|&n| (n as f32).to_le_bytes()).collect(),
            _ => numbers.iter().flat_map(|n| n.to_le_bytes()).collect(),
        };
        let members =
            [("world_from_grid.npy", npy(dtype, "False", shape, &bytes)), ("density.npy", of_value(1.0))];
        read_bytes(Format::Npz, &archive(&members, CompressionMethod::Deflated))
    };
    let rows = [[0.0, 2.0, 0.0, 0.1], [3.0, 0.0, 0.0, 5.0], [0.0, 0.0, -4.0, 6.0], [0.0, 0.0, 0.0, 1.0]];
    let rows = rows.as_flattened();
    let found = place("<f8", "(4, 4)", rows).unwrap();
    assert!(found.placed);
    assert_eq!(found.volume.grid().world_from_grid().transform_point3(DVec3::ONE), DVec3::new(2.1, 8.0, 2.0));
    let found = place("<f4", "(4, 4)", rows).unwrap().volume;
    assert_eq!(found.grid().world_from_grid().translation.x, f64::from(0.1_f32));
    assert!(reason(place("<f8", "(3, 4)", &rows[..12])).contains("(4, 4)"));
    assert!(reason(place("<f8", "(4, 4)", &[0.0; 16])).contains("0 0 0 1"));
    let singular = [&rows[..4], &rows[..4], &rows[8..]].concat();
    assert!(reason(place("<f8", "(4, 4)", &singular)).contains("singular"));
}

#[test]
fn grid_volumes_are_read() {
    let values = [0.5_f32, -3.25].map(f32::to_le_bytes).concat();
    let Stored { volume, placed, .. } = read_bytes(Format::Vol, &vol(1, [1, 1, 2], 1, &values)).unwrap();
    assert!(placed && volume.samples() == &Samples::F32(vec![0.5, -3.25]));
    assert_eq!(volume.grid().centre([0, 0, 1]), DVec3::new(0.0, 0.5, 5.0));
    let halves = [0.5_f32, -3.25, 1.0].map(|value| f16::from_f32(value).to_le_bytes()).concat();
    let colored = read_bytes(Format::Vol, &vol(2, [1, 1, 1], 3, &halves)).unwrap().volume;
    assert_eq!(colored.color(0), [0.5, -3.25, 1.0]);
    let bytes = read_bytes(Format::Vol, &vol(3, [2, 1, 1], 1, &[0, 255])).unwrap().volume;
    assert_eq!(bytes.samples(), &Samples::F32(vec![0.0, 1.0]));
}

#[test]
fn grid_volumes_that_are_none_are_refused() {
    let good = vol(1, [1, 1, 1], 1, &[0; 4]);
    assert!(read_bytes(Format::Vol, &good).is_ok());
    let told = |bytes: &[u8]| reason(read_bytes(Format::Vol, bytes));
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        told(&bytes)
    };
    assert!(with(0, b'v').contains("`VOL`"));
    assert!(with(3, 2).contains("version is 2"));
    assert!(with(4, 4).contains("directions"));
    assert!(with(4, 9).contains("encoding is 9"));
    assert!(with(4, 2).contains("asks for 2"));
    assert!(with(11, 0x80).contains("-2147483647"));
    assert!(with(8, 0).contains("sides go from 1"));
    assert!(with(20, 2).contains("2 channels"));
    assert!(with(39, 0xff).contains("is empty"));
    assert!(told(&good[..51]).contains("asks for 4"));
    assert!(told(&good[..20]).contains("too early"));
    assert!(told(&[good.as_slice(), &[0]].concat()).contains("asks for 4"));
}

fn read_raw(header: &str, data: &[u8]) -> Result<Stored> {
    let (folder, path) = folder_for(Format::Raw);
    std::fs::write(folder.path().join("a.raw"), data).unwrap();
    std::fs::write(&path, header).unwrap();
    read(&path, None)
}

#[test]
fn raw_files_are_what_their_header_says() {
    let big = [0.5_f32, -3.25].map(f32::to_be_bytes).concat();
    let header = r#"{"data": "a.raw", "size": [1, 2, 1], "channels": 1, "type": "f32", "byte_order": "big"}"#;
    let Stored { volume, placed, .. } = read_raw(header, &big).unwrap();
    assert_eq!((volume.grid(), placed), (&grid([1, 2, 1]), false));
    assert_eq!(volume.samples(), &Samples::F32(vec![0.5, -3.25]));
    let of_bytes = header.replace("f32", "u8");
    assert_eq!(read_raw(&of_bytes, &[9, 255]).unwrap().volume.samples(), &Samples::F32(vec![9.0, 255.0]));

    assert!(reason(read_raw(header, &big[1..])).contains("asks for 8"));
    assert!(reason(read_raw(header, &[big.as_slice(), &[0]].concat())).contains("asks for 8"));
    assert!(matches!(read_raw(&header.replace("a.raw", "b.raw"), &big), Err(Error::File { .. })));
    for name in
        ["../a.raw", "/etc/passwd", "sub/a.raw", "sub\\\\a.raw", "C:a.raw", "", ".", "..", "a\\u0000.raw"]
    {
        assert!(reason(read_raw(&header.replace("a.raw", name), &big)).contains("beside it"), "{name}");
    }
    for (from, to) in [
        ("\"big\"", "\"middle\""),
        ("\"f32\"", "\"f64\""),
        ("[1, 2, 1]", "[1, 2]"),
        ("[1, 2, 1]", "[1, -2, 1]"),
        ("\"channels\"", "\"Channels\""),
        ("{", "{\"color\": 1, "),
        ("{", "{\"world_from_grid\": [[1, 0, 0, 0]], "),
    ] {
        assert!(reason(read_raw(&header.replacen(from, to, 1), &big)).contains("line 1"), "{from} {to}");
    }
    let singular = r#"{"world_from_grid": [[1,0,0,0],[1,0,0,0],[0,0,1,0],[0,0,0,1]], "#;
    assert!(reason(read_raw(&header.replacen('{', singular, 1), &big)).contains("is singular"));
    assert!(reason(read_raw(&" ".repeat(100_000), &[])).contains("the most"));
}
