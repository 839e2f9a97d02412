//! `unscatter matrix`: what SciPy and NumPy would load, held against the program's own result.

use std::fs::File;
use std::io::Read;

use super::Desk;
use super::pictures::{difference, exr};
use crate::tolerances::AGAINST_EXPLICIT;

/// An array of NumPy's format 1.0 in C order, as its specification says.
struct Array {
    shape: Vec<usize>,
    descr: String,
    body: Vec<u8>,
}

impl Array {
    fn read(bytes: &[u8]) -> Self {
        assert_eq!(&bytes[..6], b"\x93NUMPY");
        assert_eq!(bytes[6], 1, "format version");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert!((10 + length).is_multiple_of(64), "the data are aligned");
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(header.contains("'fortran_order': False") && header.ends_with('\n'), "{header}");
        let between = |start: &str, end: &str| {
            let rest = header.split_once(start).unwrap().1;
            rest.split_once(end).unwrap().0.to_owned()
        };
        let shape = between("'shape': (", ")");
        let shape = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
        Self {
            shape: shape.map(|side| side.parse().unwrap()).collect(),
            descr: between("'descr': '", "'"),
            body: bytes[10 + length..].to_vec(),
        }
    }

    fn numbers<const N: usize>(&self, descr: &str, read: fn([u8; N]) -> f64) -> Vec<f64> {
        assert_eq!(self.descr, descr);
        assert_eq!(self.body.len(), N * self.shape.iter().product::<usize>());
        self.body.as_chunks::<N>().0.iter().map(|&bytes| read(bytes)).collect()
    }

    fn floats(&self) -> Vec<f64> {
        self.numbers("<f4", |bytes| f64::from(f32::from_le_bytes(bytes)))
    }

    fn colors(&self) -> Vec<[f64; 3]> {
        assert_eq!(self.shape[1], 3);
        self.floats().as_chunks::<3>().0.to_vec()
    }

    fn integers(&self) -> Vec<usize> {
        let numbers = match self.descr.as_str() {
            "<i8" => self.numbers("<i8", |bytes| i64::from_le_bytes(bytes) as f64),
            _ => self.numbers("<i4", |bytes| f64::from(i32::from_le_bytes(bytes))),
        };
        numbers.into_iter().map(|number| number as usize).collect()
    }
}

/// A matrix as `scipy.sparse.load_npz` loads it.
struct Matrix {
    shape: [usize; 2],
    indptr: Vec<usize>,
    indices: Vec<usize>,
    data: Vec<f64>,
}

impl Matrix {
    fn read(desk: &Desk, name: &str) -> Self {
        let mut archive = zip::ZipArchive::new(File::open(desk.path(name)).unwrap()).unwrap();
        let mut member = |name: &str| {
            let mut bytes = Vec::new();
            archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            Array::read(&bytes)
        };
        let format = member("format.npy");
        assert_eq!((format.shape.len(), format.descr.as_str(), &format.body[..]), (0, "|S3", &b"csr"[..]));
        let shape = member("shape.npy").integers();
        let [indptr, indices] = ["indptr.npy", "indices.npy"].map(|name| member(name).integers());
        let data = member("data.npy").floats();
        let matrix = Self { shape: [shape[0], shape[1]], indptr, indices, data };
        assert_eq!(matrix.indptr.len(), matrix.shape[0] + 1);
        assert_eq!((matrix.indptr[0], *matrix.indptr.last().unwrap()), (0, matrix.data.len()));
        assert!(matrix.indices.iter().all(|&column| column < matrix.shape[1]));
        matrix
    }

    fn times(&self, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let row = |ends: &[usize]| {
            (ends[0]..ends[1]).fold([0.0; 3], |mut sum, entry| {
                let x = x[self.indices[entry]];
                (0..3).for_each(|c| sum[c] += self.data[entry] * x[c]);
                sum
            })
        };
        self.indptr.windows(2).map(row).collect()
    }

    fn transposed_times(&self, y: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut x = vec![[0.0; 3]; self.shape[1]];
        for (ends, y) in self.indptr.windows(2).zip(y) {
            for entry in ends[0]..ends[1] {
                (0..3).for_each(|c| x[self.indices[entry]][c] += self.data[entry] * y[c]);
            }
        }
        x
    }
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum::<f64>().sqrt()
}

struct Exported {
    matrix: Matrix,
    b: Vec<[f64; 3]>,
    x0: Vec<[f64; 3]>,
    rows: Vec<[f64; 4]>,
}

fn exported(desk: &Desk) -> Exported {
    let ran = desk.done(&["matrix", "scene.json", "-o", "matrix", "--json"]);
    assert_eq!(desk.names("matrix"), ["T.npz", "b.npy", "rows.npy", "x0.npy"]);
    let array = |name: &str| Array::read(&desk.read(&format!("matrix/{name}")));
    let matrix = Matrix::read(desk, "matrix/T.npz");
    let [rows, columns] = matrix.shape;
    assert_eq!(array("b.npy").shape, [rows, 3]);
    assert_eq!(array("x0.npy").shape, [columns, 3]);
    assert_eq!(array("rows.npy").shape, [rows, 4]);
    let json = serde_json::json!({ "rows": rows, "columns": columns, "nonzeros": matrix.data.len() });
    assert_eq!(ran.json(), json);
    let described = array("rows.npy").floats().as_chunks::<4>().0.to_vec();
    Exported { matrix, b: array("b.npy").colors(), x0: array("x0.npy").colors(), rows: described }
}

#[test]
fn the_rows_are_the_painted_pixels_in_order_and_the_columns_all_texels() {
    let desk = Desk::new();
    let Exported { matrix, rows, x0, .. } = exported(&desk);
    assert_eq!(matrix.shape[1], 32 * 32);
    assert!(x0.iter().all(|&color| color == [4.0; 3]), "the radiance of the light");
    let place = |row: &[f64; 4]| (row[0] as usize, row[2] as usize, row[1] as usize);
    assert!(rows.windows(2).all(|pair| place(&pair[0]) < place(&pair[1])), "view by view, row by row");
    for row in &rows {
        assert!(row[0] < 2.0 && row[1] < 64.0 && row[2] < 36.0 && row[3] > 0.0 && row[3] <= 1.0, "{row:?}");
    }
    assert!(rows.iter().any(|row| row[..3] == [0.0, 20.0, 14.0]), "the middle of the first stroke");
    assert!(
        rows.iter().any(|row| row[..2] == [0.0, 40.0] && (row[3] - 0.6).abs() < 1e-6),
        "opacity is weight"
    );
}

/// What the program wrote solves the problem that the program exported.
#[test]
fn the_light_map_solves_the_exported_problem() {
    let desk = Desk::new();
    let Exported { matrix, b, x0, rows } = exported(&desk);
    let report = desk
        .done(&[
            "light-map",
            "scene.json",
            "-o",
            "out",
            "--json",
            "--solver",
            "cgls",
            "--tolerance",
            "1e-4",
            "--iterations",
            "3000",
        ])
        .json();
    assert_eq!(report["problem"]["nonzeros"], matrix.data.len());
    let x: Vec<[f64; 3]> =
        exr(&desk.path("out/light_map.exr")).1.iter().map(|texel| texel.map(f64::from)).collect();
    let residual = |x: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let tx = matrix.times(x);
        tx.iter().zip(&b).map(|(t, b)| std::array::from_fn(|c| t[c] - b[c])).collect()
    };
    let weighted =
        |r: &[[f64; 3]]| norm(r.iter().zip(&rows).flat_map(|(r, row)| r.map(|value| value * row[3].sqrt())));
    let change = &report["weighted_residual"];
    let reported = change["after"].as_f64().unwrap() / change["before"].as_f64().unwrap();
    let expected = weighted(&residual(&x)) / weighted(&residual(&x0));
    assert!((reported / expected - 1.0).abs() < 1e-3, "{reported} reported, {expected} by the matrix");
    // The gradient of ½ Σ w (T x − b)² + ½ λ ‖x − x₀‖² has gone.
    let lambda = report["regularization"]["tikhonov"].as_f64().unwrap();
    let gradient = |x: &[[f64; 3]]| {
        let r: Vec<[f64; 3]> =
            residual(x).iter().zip(&rows).map(|(r, row)| r.map(|value| value * row[3])).collect();
        let g = matrix.transposed_times(&r);
        norm(
            (0..x.len())
                .flat_map(|j| (0..3).map(move |c| (j, c)))
                .map(|(j, c)| g[j][c] + lambda * (x[j][c] - x0[j][c])),
        )
    };
    assert!(gradient(&x) < 1e-3 * gradient(&x0), "{} of {}", gradient(&x), gradient(&x0));
    let mut moved = x.clone();
    moved.iter_mut().for_each(|texel| texel[0] *= 1.01);
    assert!(gradient(&moved) > 1e-3 * gradient(&x0), "the gradient notices one percent");
}

/// T x is what the pictures gain, for pixels without a surface behind them that the light map would brighten.
#[test]
fn the_matrix_times_the_light_map_is_what_the_pictures_show() {
    let mut scene = super::scene_with("/medium/albedo", serde_json::json!(1.0));
    let occluders = scene["occluders"].as_array_mut().unwrap();
    occluders.iter_mut().for_each(|occluder| {
        let shape = occluder.as_object_mut().unwrap().values_mut().next().unwrap();
        shape["albedo"] = serde_json::json!(0.0);
    });
    let desk = Desk::with(&scene);
    let Exported { matrix, x0, rows, .. } = exported(&desk);
    desk.done(&["light-map", "scene.json", "-o", "out"]);
    let x: Vec<[f64; 3]> =
        exr(&desk.path("out/light_map.exr")).1.iter().map(|texel| texel.map(f64::from)).collect();
    let (after, before) = (matrix.times(&x), matrix.times(&x0));
    let change: Vec<[f32; 3]> =
        after.iter().zip(&before).map(|(a, b)| std::array::from_fn(|c| (a[c] - b[c]) as f32)).collect();
    let pictures = ["left", "right"]
        .map(|view| ["after", "before"].map(|kind| exr(&desk.path(&format!("out/{view}_{kind}.exr"))).1));
    let shown: Vec<[f32; 3]> = rows
        .iter()
        .map(|row| {
            let [after, before] = &pictures[row[0] as usize];
            let pixel = row[2] as usize * 64 + row[1] as usize;
            std::array::from_fn(|c| after[pixel][c] - before[pixel][c])
        })
        .collect();
    let got = difference(&shown, &change);
    assert!(got < AGAINST_EXPLICIT, "{got}");
    let shifted: Vec<[f32; 3]> = shown.iter().cycle().skip(1).take(shown.len()).copied().collect();
    assert!(difference(&shifted, &change) > 1e3 * AGAINST_EXPLICIT, "rows in another order are noticed");
}

#[test]
fn one_matrix_cannot_hold_three_channels() {
    let desk = Desk::new();
    desk.run(&["matrix", "scene.json", "-o", "out", "--set", "medium.sigma_t=[0.1, 0.2, 0.3]"])
        .exits_with(1)
        .tells("medium");
    assert!(desk.names("out").is_empty());
}
