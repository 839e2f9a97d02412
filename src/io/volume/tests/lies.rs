//! Files that lie about what is in them.

use super::*;

#[test]
fn archives_that_lie_are_refused() {
    let told = |bytes: &[u8]| reason(read_bytes(Format::Npz, bytes));
    let whole = archive(&[("a.npy", of_value(1.0))], CompressionMethod::Stored);
    let value = whole.windows(4).position(|bytes| bytes == 1.0_f32.to_le_bytes()).unwrap();
    let mut damaged = whole.clone();
    damaged[value] ^= 1;
    assert!(told(&damaged).contains("damaged"), "{}", told(&damaged));

    let longer = [of_value(1.0), vec![0]].concat();
    let longer = archive(&[("a.npy", longer)], CompressionMethod::Deflated);
    assert!(told(&longer).contains("more values"), "{}", told(&longer));

    // Sizes, packed and not, in the entry of the directory.
    let entry = whole.windows(4).position(|bytes| bytes == b"PK\x01\x02").unwrap();
    for (packed, size) in [(4_000_000_000, 4_000_000_000), (0, 4_000_000_000_u32), (4_000_000_000, 4)] {
        let mut lying = whole.clone();
        lying[entry + 20..entry + 24].copy_from_slice(&u32::to_le_bytes(packed));
        lying[entry + 24..entry + 28].copy_from_slice(&size.to_le_bytes());
        assert!(!told(&lying).is_empty());
    }
    let bomb = npy("<f4", "False", "(4096, 4096, 32, 3)", &vec![0; 1 << 20]);
    let bomb = archive(&[("a.npy", bomb)], CompressionMethod::Deflated);
    assert!(bomb.len() < 4096 && told(&bomb).contains("too few"));
}

/// The directory of a zip archive that says of itself how long it is.
fn directory_that_claims(entries: u64, bytes: u64, start: u64) -> Vec<u8> {
    let mut end = b"PK\x06\x06".to_vec();
    end.extend(44_u64.to_le_bytes());
    end.extend([45_u16.to_le_bytes(), 45_u16.to_le_bytes()].concat());
    end.extend([0; 8]);
    end.extend([entries, entries, bytes, start].map(u64::to_le_bytes).concat());
    end.extend(b"PK\x06\x07\0\0\0\0");
    end.extend([0; 8]);
    end.extend(1_u32.to_le_bytes());
    end.extend(b"PK\x05\x06\0\0\0\0");
    end.extend([0xff; 12]);
    end.extend([0; 2]);
    end
}

#[test]
fn files_that_claim_petabytes_are_refused_at_once() {
    let begun = Instant::now();
    let shapes =
        ["(4096, 4096, 4096)", "(4096, 4096, 4096, 3)", "(99999999, 99999999, 99999999)", "(4096, 4096, 32)"];
    for shape in shapes {
        let array = npy("<f8", "False", shape, &[0; 64]);
        assert!(read_bytes(Format::Npy, &array).is_err());
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let archive = archive(&[("a.npy", array.clone())], method);
            assert!(read_bytes(Format::Npz, &archive).is_err());
        }
    }
    let counts = [1, 1 << 20, 1 << 40, 1 << 50, u64::MAX];
    for (entries, bytes) in counts.into_iter().flat_map(|entries| counts.map(|bytes| (entries, bytes))) {
        for start in counts {
            assert!(read_bytes(Format::Npz, &directory_that_claims(entries, bytes, start)).is_err());
        }
    }
    for size in [[4096_i32; 3], [i32::MAX; 3], [-1; 3], [4096, 4096, 32]] {
        assert!(read_bytes(Format::Vol, &vol(1, size, 1, &[0; 64])).is_err());
        let header = format!(r#"{{"data":"a.raw","size":{size:?},"channels":1,"type":"f32"}}"#);
        assert!(read_bytes(Format::Raw, header.as_bytes()).is_err());
    }
    for format in OURS {
        let (_folder, path) = folder_for(format);
        // Nothing but a hole, where file systems have such.
        if File::create(&path).unwrap().set_len(1 << 40).is_ok() {
            assert!(read(&path, None).is_err());
        }
    }
    assert!(begun.elapsed().as_secs() < 5, "{:?}", begun.elapsed());
}
