"""Checks the VDB reader and writer against OpenVDB itself.

    vdb_peer.py make FOLDER [RECOMPRESS]
        Writes VDB files with OpenVDB into FOLDER, and beside each grid what a reader must find. RECOMPRESS is the
        program of tests/fixtures/vdb/recompress.cpp; with it every file is also saved in each other way of packing.
    vdb_peer.py verify FOLDER
        Reads the VDB files in FOLDER with OpenVDB and compares them with what stands beside them. Says where they
        differ and exits with 3 then.

What is expected of the grid NAME of FILE.vdb stands in FILE.NAME.json and FILE.NAME.f32 (little-endian, in NumPy's
order (z, y, x, channel)):

    {"file": "FILE.vdb", "grid": "NAME", "size": [x, y, z], "channels": 1 or 3, "half": true or false,
     "world_from_grid": [x axis, y axis, z axis, origin: twelve numbers]}

where `world_from_grid` takes (0, 0, 0) to the corner of the first voxel of the box. Needs the module `pyopenvdb`
(Debian: python3-openvdb) and NumPy.
"""

import itertools
import json
import pathlib
import subprocess
import sys

import numpy
import pyopenvdb

RANDOM = numpy.random.default_rng(20)


# ---- what OpenVDB finds in a grid


def dense(grid, first, size):
    """The values of a box, active or not, as (z, y, x, channel)."""
    channels = 3 if grid.valueTypeName == "vec3s" else 1
    values = numpy.zeros(tuple(size) + ((3,) if channels == 3 else ()), numpy.float32)
    grid.copyToArray(values, ijk=tuple(int(at) for at in first))
    return values.reshape(tuple(size) + (channels,)).transpose(2, 1, 0, 3)


def world_from_grid(grid, first):
    """Axes and origin of the corner of voxel `first`; indices name the centres of voxels."""
    corner = numpy.array(first) - 0.5
    world = lambda at: numpy.array(grid.transform.indexToWorld(tuple(at)))
    axes = [world(corner + axis) - world(corner) for axis in numpy.eye(3)]
    return numpy.concatenate(axes + [world(corner)])


def expect(folder, file, name, grid):
    first, last = grid.evalActiveVoxelBoundingBox()
    size = numpy.array(last) - numpy.array(first) + 1
    values = dense(grid, first, size)
    record = {
        "file": f"{file}.vdb",
        "grid": name,
        "size": size.tolist(),
        "channels": values.shape[3],
        "half": grid.saveFloatAsHalf,
        "world_from_grid": world_from_grid(grid, first).tolist(),
    }
    (folder / f"{file}.{name}.json").write_text(json.dumps(record))
    (folder / f"{file}.{name}.f32").write_bytes(values.astype("<f4").tobytes())


# ---- grids of every kind


def boxes(kind):
    """A full box that no leaf begins with, and one with holes."""
    for name, at in [("box", (0, 0, 0)), ("moved", (-21, 5, -130))]:
        grid = kind()
        values = RANDOM.normal(size=(19, 10, 13) + ((3,) if kind is pyopenvdb.Vec3SGrid else ()))
        grid.copyFromArray(values.astype(numpy.float32), ijk=at)
        yield name, grid
    grid = kind()
    values[RANDOM.random(values.shape[:3]) < 0.7] = 0
    grid.copyFromArray(values.astype(numpy.float32))
    grid.pruneInactive()
    yield "holes", grid


def codes(kind):
    """A leaf for each code of inactive values, and every way of the tree to be partly filled."""
    value = (lambda a: (a, -2 * a, a + 1)) if kind is pyopenvdb.Vec3SGrid else (lambda a: a)
    background = value(3.0)
    minus = (-3.0, 6.0, -4.0) if kind is pyopenvdb.Vec3SGrid else -3.0
    grid = kind(background)
    accessor = grid.getAccessor()
    inactive = [
        [background],
        [minus],
        [value(5.0)],
        [minus, background],
        [value(5.0), background],
        [value(5.0), value(6.0)],
        [value(5.0), value(6.0), value(7.0)],
        [minus, value(6.0)],
    ]
    for leaf, values in enumerate(inactive):
        for place in itertools.product(range(8), repeat=3):
            at = (8 * leaf + place[0] - 40, place[1], place[2])
            if RANDOM.random() < 0.3:
                accessor.setValueOn(at, value(float(RANDOM.normal())))
            else:
                accessor.setValueOff(at, values[RANDOM.integers(len(values))])
    yield "codes", grid
    grid = kind(background)
    accessor = grid.getAccessor()
    accessor.setValueOn((1000, 0, 3), value(1.0))
    accessor.setValueOn((-100, -3, 3), value(2.0))
    yield "background", grid


def tiles(kind):
    """Active and inactive tiles of 8, 128 and 4096 voxels a side."""
    value = (lambda a: (a, a / 2, 0.0)) if kind is pyopenvdb.Vec3SGrid else (lambda a: a)
    grid = kind(value(0.25))
    grid.fill((-3, -4, -5), (290, 140, 150), value(1.5))
    grid.fill((20, 20, 20), (100, 60, 60), value(-1.0), active=False)
    grid.fill((130, 0, 0), (140, 9, 9), value(7.0))
    grid.fill((0, 0, 0), (127, 127, 127), value(4.0), active=False)
    grid.getAccessor().setValueOn((64, 64, 64), value(9.0))
    grid.prune(grid.zeroValue)
    yield "tiles", grid
    grid = kind(value(0.5))
    grid.fill((4096, 4096, 4096), (8191, 8191, 8191), value(-2.0), active=False)
    grid.getAccessor().setValueOn((4095, 4100, 4100), value(1.0))
    grid.getAccessor().setValueOn((4100, 4095, 4095), value(2.0))
    yield "root", grid


def transforms():
    rotation = numpy.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]])
    shear = numpy.array([[0.3, 0.1, 0], [0, -0.4, 0.05], [0.02, 0, 0.5]])
    for name, linear, origin in [
        ("uniform", 0.1 * numpy.eye(3), (0, 0, 0)),
        ("placed", 0.1 * numpy.eye(3), (1, 2, 3)),
        ("scaled", numpy.diag([0.1, 0.2, -0.5]), (0, 0, 0)),
        ("both", numpy.diag([0.1, 0.2, 0.5]), (-1, 7, 0.5)),
        ("translated", numpy.eye(3), (5, -6, 0.25)),
        ("rotated", rotation, (0, 0, 0)),
        ("affine", shear, (3, 2, 1)),
    ]:
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(RANDOM.random((3, 4, 5)).astype(numpy.float32), ijk=(2, -1, 9))
        matrix = numpy.eye(4)
        matrix[:3, :3] = linear
        matrix[3, :3] = origin
        grid.transform = pyopenvdb.createLinearTransform(matrix.tolist())
        yield name, grid


def files():
    """Name of a file, and its grids."""
    for suffix, kind in [("", pyopenvdb.FloatGrid), ("_vec3s", pyopenvdb.Vec3SGrid)]:
        for name, grid in itertools.chain(boxes(kind), codes(kind), tiles(kind)):
            for half in [False, True]:
                copy = grid.deepCopy()
                copy.saveFloatAsHalf = half
                copy.name = "density"
                yield name + suffix + ("_half" if half else ""), [copy]
    for name, grid in transforms():
        grid.name = "density"
        yield name, [grid]
    sphere = pyopenvdb.createLevelSetSphere(radius=3.0, center=(1.0, 0.0, -2.0), voxelSize=0.25)
    sphere.name = "surface"
    yield "level_set", [sphere]
    values = sphere.deepCopy()
    values.gridClass = pyopenvdb.GridClass.UNKNOWN
    yield "values_of_a_level_set", [values]
    several = [grid for _, grid in itertools.chain(boxes(pyopenvdb.FloatGrid), boxes(pyopenvdb.Vec3SGrid))]
    for grid, name in zip(several, ["density", "heat", "flow", "flow", "velocity", "density2"]):
        grid.name = name
        grid["note"] = "a value that readers may skip"
    yield "several", several


def names_of(grids):
    """As readers tell grids apart: with a number where they share a name."""
    names = [grid.name for grid in grids]
    for index, name in enumerate(names):
        shared = names.count(name) > 1
        yield f"{name}[{names[:index].count(name)}]" if shared else name


def make(folder, recompress=None):
    folder.mkdir(parents=True, exist_ok=True)
    for file, grids in files():
        variants = [file]
        pyopenvdb.write(str(folder / f"{file}.vdb"), grids=grids, metadata={"made by": "vdb_peer.py"})
        if recompress:
            ways = itertools.product(["none", "zip", "blosc"], [[], ["mask"]])
            for way, mask in ways:
                variants.append("_".join([file, way, *mask]))
                pair = [str(folder / f"{variant}.vdb") for variant in (file, variants[-1])]
                subprocess.run([recompress, *pair, way, *mask], check=True)
        for variant in variants:
            # Read back, as half precision changes values.
            stored, _ = pyopenvdb.readAll(str(folder / f"{variant}.vdb"))
            by_order = sorted(stored, key=lambda grid: grid.name)
            for name, grid in zip(names_of(by_order), by_order):
                expect(folder, variant, name, grid)


# ---- files to verify


def differences(folder, record, values):
    """What OpenVDB finds in a file that is not as the record beside it says."""
    grid = pyopenvdb.read(str(folder / record["file"]), record["grid"])
    channels, size = record["channels"], record["size"]
    metadata = pyopenvdb.readGridMetadata(str(folder / record["file"]), record["grid"]).metadata
    active = values.any(axis=3)
    places = numpy.argwhere(active)[:, ::-1]
    yield "name", grid.name, record["grid"]
    yield "type", grid.valueTypeName, "vec3s" if channels == 3 else "float"
    yield "background", numpy.ravel(grid.background).tolist(), [0.0] * channels
    yield "half", grid.saveFloatAsHalf, record["half"]
    yield "active voxels", grid.activeVoxelCount(), len(places)
    yield "creator", grid.creator, "unscatter"
    yield "file_voxel_count", metadata["file_voxel_count"], len(places)
    if len(places):
        box = (tuple(places.min(axis=0)), tuple(places.max(axis=0)))
        yield "active box", grid.evalActiveVoxelBoundingBox(), box
        yield "stated box", (metadata.get("file_bbox_min"), metadata.get("file_bbox_max")), box
    zero = [item.min for item in grid.citerOnValues() if not numpy.any(item.value)]
    yield "active where it is 0", zero[:3], []
    found = dense(grid, (0, 0, 0), size)
    if not numpy.array_equal(found, values):
        at = numpy.argwhere(found != values)[0]
        yield f"value at (z, y, x, channel) = {at.tolist()}", found[tuple(at)], values[tuple(at)]
    placed = world_from_grid(grid, (0, 0, 0))
    if not numpy.allclose(placed, record["world_from_grid"], rtol=1e-12, atol=1e-12):
        yield "world_from_grid", placed.tolist(), record["world_from_grid"]


def verify(folder):
    records = sorted(folder.glob("*.json"))
    failures = 0
    for path in records:
        record = json.loads(path.read_text())
        shape = record["size"][::-1] + [record["channels"]]
        values = numpy.fromfile(path.with_suffix(".f32"), "<f4").reshape(shape)
        for what, found, expected in differences(folder, record, values):
            if found != expected:
                failures += 1
                print(f"{path.name}: {what} is {found}, not {expected}")
    print(f"{len(records)} grids verified, {failures} differences")
    return 3 if failures or not records else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", folder, *recompress]:
            make(pathlib.Path(folder), *recompress)
        case ["verify", folder]:
            sys.exit(verify(pathlib.Path(folder)))
        case _:
            sys.exit(__doc__)
