"""What users would take instead of unscatter, on the same problems; run.sh prepares what this reads.

Usage: compare.py DIR   (DIR holds ours.json and its files, light_map.json, and matrix/)
Prints a Markdown table: seconds to set up, of T x and of T' y (medians), and how far T x is from ours.
"""
import json
import os
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
FOLDER = sys.argv[1]
TRIALS = 5
rows = []


def read(name):
    return np.fromfile(os.path.join(FOLDER, name + ".f32"), np.float32)


def median(work):
    seconds = []
    for _ in range(TRIALS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return sorted(seconds)[TRIALS // 2]


def off(theirs, ours):
    """The relative distance, in per cent."""
    return f"{100 * np.linalg.norm(theirs - ours) / np.linalg.norm(ours):.2g} %"


def add(work, who, set_up, forward, backward, agreement):
    show = lambda s: "" if s is None else f"{1e3 * s:,.0f} ms" if s >= 0.1 else f"{1e3 * s:.1f} ms"
    rows.append((work, who, show(set_up), show(forward), show(backward), agreement))


def add_ours(work, measured):
    for name, m in measured.items():
        agreement = "" if name == "kept" else f"{100 * m['forward_off']:.2g} %"
        add(work, f"unscatter, rows {name}", m["set_up"], m["forward"], m["backward"], agreement)


def astra_slice():
    """A fan of rays through pixels: their lengths (the line kernel of ASTRA's CPU projector), and a matrix of them in SciPy."""
    import astra

    side, sides = 512, 180
    values = read("slice_values").reshape(side, side)
    lengths = read("slice_lengths").reshape(sides, side)
    start = time.perf_counter()
    volume = astra.create_vol_geom(side, side, -1, 1, -1, 1)
    # ASTRA's sources turn as (sin, -cos) and its detectors as (cos, sin); rows of a picture go down.
    fan = astra.create_proj_geom("fanflat", 6 / side, side, np.arange(sides) * 2 * np.pi / sides, 4, 4)
    projector = astra.create_projector("line_fanflat", fan, volume)
    set_up = time.perf_counter() - start
    picture = np.ascontiguousarray(values[::-1])
    operator = astra.OpTomo(projector)
    theirs = operator.FP(picture)
    best = min((theirs, theirs[:, ::-1]), key=lambda a: np.linalg.norm(a - lengths))
    forward, backward = median(lambda: operator.FP(picture)), median(lambda: operator.BP(theirs))
    add("slice", f"ASTRA {astra.__version__}, line_fanflat", set_up, forward, backward, off(best, lengths))
    start = time.perf_counter()
    matrix = astra.matrix.get(astra.projector.matrix(projector)).tocsr()
    kept = time.perf_counter() - start
    x = np.repeat(picture.reshape(-1, 1), 3, 1).astype(np.float32)
    y = (matrix @ x).astype(np.float32)
    forward, backward = median(lambda: matrix @ x), median(lambda: matrix.T @ y)
    add("slice", "ASTRA's matrix in SciPy, 3 channels", set_up + kept, forward, backward, "")


# The march: voxels a side, steps, and their length.
SIDE, STEPS = 128, 256
STEP = 2 * np.sqrt(3) / STEPS


@dr.syntax
def gather(origin, direction, sigma_t, emission):
    radiance, tau, i, t = mi.Color3f(0), mi.Float(0), mi.UInt32(0), mi.Float(3 - np.sqrt(3) + 0.5 * STEP)
    while i < STEPS:
        q = (origin + direction * t + 1) * 0.5
        inside = dr.all((q >= 0) & (q <= 1))
        s = sigma_t.eval(q, active=inside)[0] & inside
        weight = dr.exp(-tau) * (1 - dr.exp(-s * STEP))
        e = emission.eval(q, active=inside)
        radiance += dr.select(inside, weight * mi.Color3f(e[0], e[1], e[2]), 0)
        tau += s * STEP
        t += STEP
        i += 1
    return radiance


@dr.syntax
def scatter(origin, direction, sigma_t, residual, out):
    tau, i, t = mi.Float(0), mi.UInt32(0), mi.Float(3 - np.sqrt(3) + 0.5 * STEP)
    while i < STEPS:
        q = (origin + direction * t + 1) * 0.5
        inside = dr.all((q >= 0) & (q <= 1))
        s = sigma_t.eval(q, active=inside)[0] & inside
        weight = dr.exp(-tau) * (1 - dr.exp(-s * STEP))
        active = inside & (s > 0)
        cell = q * SIDE - 0.5
        base, part = mi.Vector3i(dr.floor(cell)), cell - dr.floor(cell)
        for tap in range(8):
            corner = (tap & 1, tap >> 1 & 1, tap >> 2)
            at = dr.clip(base + mi.Vector3i(*corner), 0, SIDE - 1)
            w = mi.Float(weight)
            for axis in range(3):
                w = w * (part[axis] if corner[axis] else 1 - part[axis])
            place = mi.UInt32((at[2] * SIDE + at[1]) * SIDE + at[0])
            for c in range(3):
                dr.scatter_reduce(dr.ReduceOp.Add, out, w * residual[c], place * 3 + c, active)
        tau += s * STEP
        t += STEP
        i += 1
    return tau


def march(name):
    """Emission by a hand-written march of 256 steps in Dr.Jit."""
    side, width = SIDE, 480
    start = time.perf_counter()
    sigma_t = mi.Texture3f(mi.TensorXf(read(name + "_sigma_t").reshape(side, side, side, 1)))
    emission = mi.Texture3f(mi.TensorXf(read(name + "_emission").reshape(side, side, side, 3)))
    index = dr.arange(mi.UInt32, 2 * width * width)
    view, pixel = index // (width * width), index % (width * width)
    u = (mi.Float(pixel % width) + 0.5) / width - 0.5
    v = (mi.Float(pixel // width) + 0.5) / width - 0.5
    # Seen along +z the camera's right is -x; seen along +x it is +z.
    direction = dr.normalize(dr.select(view == 0, mi.Vector3f(-u, -v, 1), mi.Vector3f(1, -v, u)))
    origin = dr.select(view == 0, mi.Vector3f(0, 0, -3), mi.Vector3f(-3, 0, 0))
    dr.eval(direction, origin)
    dr.sync_thread()
    set_up = time.perf_counter() - start

    def run_forward():
        radiance = gather(origin, direction, sigma_t, emission)
        dr.eval(radiance)
        dr.sync_thread()
        return radiance

    radiance = run_forward()

    def run_backward():
        out = dr.zeros(mi.Float, side**3 * 3)
        done = scatter(origin, direction, sigma_t, radiance, out)
        dr.eval(done, out)
        dr.sync_thread()

    run_backward()
    theirs = np.array(radiance).T
    agreement = off(theirs, read(name + "_pictures").reshape(-1, 3))
    who = f"Dr.Jit (Mitsuba {mi.__version__}), {STEPS} steps"
    add(name, who, set_up, median(run_forward), median(run_backward), agreement)


def path_replay():
    """The gradient of an albedo by Mitsuba's prbvolpath, one sample a pixel; the estimate is noisy, so nothing is compared."""
    side = 128
    sigma_t = read("sparse_sigma_t").reshape(side, side, side, 1)
    cube = mi.ScalarTransform4f().translate([-1, -1, -1]).scale(2)
    start = time.perf_counter()
    sensors = [
        mi.load_dict({
            "type": "perspective", "fov": 2 * np.degrees(np.arctan(0.5)), "sampler": {"type": "independent"},
            "to_world": mi.ScalarTransform4f().look_at(origin=eye, target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 480, "height": 480, "rfilter": {"type": "box"}},
        })
        for eye in ([0, 0, -3], [-3, 0, 0])
    ]
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "prbvolpath", "max_depth": 2},
        "sky": {"type": "constant"},
        "box": {
            "type": "cube", "bsdf": {"type": "null"},
            "interior": {
                "type": "heterogeneous",
                "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(sigma_t), "to_world": cube},
                "albedo": {
                    "type": "gridvolume", "to_world": cube,
                    "grid": mi.VolumeGrid(np.full((side, side, side, 3), 0.8, np.float32)),
                },
            },
        },
    })
    parameters = mi.traverse(scene)
    key = next(key for key in parameters.keys() if key.endswith("albedo.data"))
    set_up = time.perf_counter() - start

    def render():
        pictures = [mi.render(scene, sensor=sensor, spp=1, seed=1) for sensor in sensors]
        dr.eval(pictures)
        dr.sync_thread()

    def gradient():
        dr.enable_grad(parameters[key])
        for sensor in sensors:
            dr.backward(dr.mean(mi.render(scene, parameters, sensor=sensor, spp=1, seed=1) ** 2, axis=None))
        dr.eval(dr.grad(parameters[key]))
        dr.sync_thread()

    render(), gradient()
    add("sparse", f"Mitsuba {mi.__version__}, prbvolpath, 1 sample a pixel", set_up, median(render), median(gradient), "noisy")


def least_squares():
    """LSQR with 32 iterations for three channels on the citadel's exported matrix."""
    import scipy
    import scipy.sparse as sparse
    from scipy.sparse.linalg import lsqr

    start = time.perf_counter()
    folder = os.path.join(FOLDER, "matrix")
    matrix = sparse.load_npz(os.path.join(folder, "T.npz")).astype(np.float32).tocsr()
    b = np.load(os.path.join(folder, "b.npy")).astype(np.float32)
    x0 = np.load(os.path.join(folder, "x0.npy")).astype(np.float32)
    weight = np.sqrt(np.load(os.path.join(folder, "rows.npy"))[:, 3]).astype(np.float32)
    weighted = sparse.diags(weight).astype(np.float32) @ matrix
    set_up = time.perf_counter() - start
    y = matrix @ x0
    forward, backward = median(lambda: matrix @ x0), median(lambda: matrix.T @ y)
    start = time.perf_counter()
    residual = (b - y) * weight[:, None]
    for c in range(3):
        lsqr(weighted, residual[:, c], atol=0, btol=0, iter_lim=32)
    solve = time.perf_counter() - start
    add("light map", f"SciPy {scipy.__version__}, exported matrix", set_up, forward, backward, f"32 LSQR iterations: {solve:.2f} s")


def light_map():
    with open(os.path.join(FOLDER, "light_map.json")) as file:
        report = json.load(file)
    timings = report["timings"]
    solve = f"32 LSQR iterations: {report['history'][-1]['seconds']:.2f} s"
    add("light map", "unscatter light-map --solver lsqr", timings["tracing"] + timings["walking"], None, None, solve)


with open(os.path.join(FOLDER, "ours.json")) as file:
    ours = json.load(file)
light_map()
steps = [("light map", least_squares, ())]
for work in ("sparse", "dense"):
    add_ours(work, ours[work])
    steps.append((work, march, (work,)))
add_ours("slice", ours["slice"])
steps += [("sparse", path_replay, ()), ("slice", astra_slice, ())]
failed = False
for work, step, arguments in steps:
    try:
        step(*arguments)
    except Exception as error:  # what one peer lacks must not hide the others
        failed = True
        add(work, step.__name__, None, None, None, f"could not be run: {type(error).__name__}: {error}"[:120])
order = ["light map", "sparse", "dense", "slice"]
rows.sort(key=lambda row: order.index(row[0]))
print("| work | who | set-up | T x | Tᵀ y | |\n|---|---|---|---|---|---|")
for row in rows:
    print("| " + " | ".join(row) + " |")
sys.exit(1 if failed else 0)
