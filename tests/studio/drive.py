"""The studio as an artist uses it: headless Chromium, driven by Playwright.

    python3 tests/studio/drive.py PROGRAM [--strokes N] [--seconds N] [--shots FOLDER]

Paints by mouse on a copy of the citadel, and holds what the page shows against what the command finds. Prints figures; ends with an error where something is
wrong. `--strokes` are timed, `--seconds` are spent on random painting, undo and zooming.
"""
import argparse
import atexit
import base64
import json
import math
import os
import pathlib
import random
import shutil
import signal
import statistics
import subprocess
import tempfile
import time

from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Studio:
    """A program that serves a scene."""

    def __init__(self, program, scene):
        self.process = subprocess.Popen(
            [program, "paint", str(scene), "--no-open", "-o", str(scene.parent / "out")], stdout=subprocess.PIPE, text=True)
        atexit.register(self.process.kill)
        self.address = self.process.stdout.readline().split()[-1]
        assert self.address.startswith("http://127.0.0.1:"), self.address

    def resident(self):
        """MiB of memory."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    def end(self, with_signal=signal.SIGTERM):
        self.process.send_signal(with_signal)
        return self.process.wait(30)


def opened(browser, address, faults, size=(1440, 900)):
    page = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme="dark").new_page()
    page.on("console", lambda told: faults.append(told.text) if told.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(address)
    until(page, "() => window.studio?.state.socket === 'open' && document.querySelector('#status').dataset.serial !== ''")
    return page


def until(page, what, argument=None, patience=60):
    """Asks again and again: the page's policy forbids what Playwright has for this."""
    clock = time.time()
    while not page.evaluate(what, argument):
        assert time.time() - clock < patience, f"{what} does not come"
        page.wait_for_timeout(15)


def count(page, view=0):
    return page.evaluate("view => window.studio.state.strokes[view].length", view)


def until_done(page):
    until(page, """() => {
        const { state } = window.studio;
        const after = state.pictures.get(`after/${state.view}`);
        return state.progress?.phase === 'done' && after?.stage === 'full' && after.revision === state.revision;
    }""")


def drag(page, points):
    """By mouse; points in pixels of the full picture."""
    places = page.evaluate("points => points.map(([x, y]) => window.studio.toScreen(x, y))", points)
    page.mouse.move(places[0]["x"], places[0]["y"])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(place["x"], place["y"], steps=6)
    page.mouse.up()


def paint(page, points, view=0):
    before = count(page, view)
    drag(page, points)
    until(page, "([view, before]) => window.studio.state.strokes[view].length === before + 1", [view, before])


def frames(page):
    """How many a second are drawn while the pen is down."""
    count = page.evaluate("window.studio.state.strokes[0].length")
    page.evaluate("""() => {
        window.drawn = 0;
        const draw = () => { window.drawn += 1; requestAnimationFrame(draw); };
        requestAnimationFrame(draw);
    }""")
    place = page.evaluate("window.studio.toScreen(200, 150)")
    page.mouse.move(place["x"], place["y"])
    page.mouse.down()
    clock, before = time.time(), page.evaluate("window.drawn")
    for step in range(90):
        page.mouse.move(place["x"] + 3 * step, place["y"] + 30 * math.sin(step / 8))
        page.wait_for_timeout(8)
    rate = (page.evaluate("window.drawn") - before) / (time.time() - clock)
    page.mouse.up()
    until(page, "count => window.studio.state.strokes[0].length === count + 1", count)
    until_done(page)
    return rate


def press(page, points, pressures):
    """By a pen."""
    places = page.evaluate("points => points.map(([x, y]) => window.studio.toScreen(x, y))", points)
    pen = page.context.new_cdp_session(page)
    kinds = ["mousePressed"] + ["mouseMoved"] * (len(points) - 1)
    for kind, place, pressure in zip(kinds + ["mouseReleased"], places + places[-1:], list(pressures) + [0]):
        pen.send("Input.dispatchMouseEvent", {
            "type": kind, "x": place["x"], "y": place["y"], "button": "left", "buttons": 0 if kind == "mouseReleased" else 1,
            "clickCount": 1, "pointerType": "pen", "force": pressure})
        page.wait_for_timeout(20)


def fly(page):
    """Looks from elsewhere, and turns there."""
    page.keyboard.press("c")
    until(page, "() => window.studio.state.free?.isSeen")
    box = page.locator("#view-canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + random.uniform(-90, 90), y + random.uniform(0, 40), steps=5)
    page.mouse.up()
    page.mouse.wheel(0, random.uniform(-200, 200))
    page.wait_for_timeout(300)


def picture_drawn(page):
    """What is on the canvas of pictures, in short."""
    return page.evaluate("""() => {
        const canvas = document.getElementById('picture-canvas');
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        return data.reduce((sum, value, index) => (sum * 31 + value * (index % 97)) % 1000003, 7);
    }""")


def shown(page):
    """What the page has of the first view under the light map."""
    return page.evaluate("""() => {
        const { size, stage, canvas } = window.studio.state.pictures.get('after/0');
        return { size, stage, bytes: Array.from(canvas.getContext('2d').getImageData(0, 0, ...size).data) };
    }""")


def decoded(page, png):
    """The pixels of a PNG file, as the browser has them."""
    source = "data:image/png;base64," + base64.b64encode(png.read_bytes()).decode()
    return page.evaluate("""async (source) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [image.width, image.height];
        const context = canvas.getContext('2d', { colorSpace: 'srgb' });
        context.drawImage(image, 0, 0);
        return Array.from(context.getImageData(0, 0, image.width, image.height).data);
    }""", source)


def told(page, what):
    """Waits until the looks are so, and the server has said so."""
    until(page, f"""() => {{
        const {{ looks, places, isTold }} = window.studio.state.looks;
        return isTold && ({what});
    }}""")


def looks(page, scene, program, shot):
    """By the panel: an edit of shadows, a transfer function, points on its table and in the picture, and what is saved of them."""
    page.keyboard.press("Control+s")
    until(page, "() => window.studio.state.isSaved")
    before = scene.read_text()
    page.click("#looks-section > summary")
    page.click("#add-edits button >> text=Fill")
    told(page, "looks.occluders?.length === 1 && looks.occluders[0].fill.texels > 0")
    reach = page.evaluate("window.studio.state.looks.looks.occluders[0].fill.texels")
    page.focus("#edits input[data-key=Reach]")
    for _ in range(40):
        page.keyboard.press("ArrowRight")
    told(page, f"looks.occluders[0].fill.texels > {reach}")
    # The steps of a drag are one.
    page.keyboard.press("Control+z")
    told(page, f"looks.occluders[0].fill.texels === {reach}")
    page.keyboard.press("Control+Shift+Z")
    told(page, f"looks.occluders[0].fill.texels > {reach}")
    # Up and down, and gone.
    page.click("#add-edits button >> text=Pierce")
    told(page, "looks.occluders.length === 2")
    page.click("#edits .row:nth-child(2) button[title='Move up']")
    told(page, "'pierce' in looks.occluders[0]")
    page.click("#edits .row:nth-child(1) button[title='Remove']")
    told(page, "looks.occluders.length === 1 && 'fill' in looks.occluders[0]")

    page.locator("#transfer-on").click()
    told(page, "looks.transfer?.layers.length === 1")
    table = page.locator("#table")
    table.scroll_into_view_if_needed()
    box = table.bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 0.3 * box["height"])
    told(page, "looks.transfer.layers[1]?.diffusion.points.length === 1 && places[1]?.length === 1")
    at = page.evaluate("window.studio.state.looks.looks.transfer.layers[1].diffusion.points[0].at")
    assert abs(at[0] - 0.8) < 0.02 and abs(at[1] - 0.3) < 0.02, at
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"], steps=8)
    page.mouse.up()
    told(page, "Math.abs(looks.transfer.layers[1].diffusion.points[0].at[0] - 0.5) < 0.02")
    # Its colour, by the picker beside the panel.
    page.click("#layers .spot[data-key='Colour of the point']")
    page.click("#colour-sheet .swatch[data-color='#2f6bff']")
    told(page, "looks.transfer.layers[1].diffusion.points[0].color === '#2f6bff'")
    shot("looks-colour")
    page.keyboard.press("Escape")
    # In the picture.
    strokes = count(page)
    page.click("#layers button >> text=Place in the picture")
    place = page.evaluate("window.studio.toScreen(320, 180)")
    page.mouse.click(place["x"], place["y"])
    told(page, "looks.transfer.layers[1].diffusion.points[1]?.pixel?.[0] > 300 && places[1]?.length === 2")
    assert count(page) == strokes and page.evaluate("window.studio.state.asks === null")
    until_done(page)
    shot("looks")
    # Delete belongs to the point.
    page.keyboard.press("Delete")
    told(page, "looks.transfer.layers[1].diffusion.points.length === 1")
    page.keyboard.press("Control+z")
    told(page, "looks.transfer.layers[1].diffusion.points.length === 2")
    until_done(page)

    page.keyboard.press("Control+s")
    until(page, "() => window.studio.state.isSaved")
    saved = scene.read_text()
    assert saved.startswith(before.rstrip()[:-1].rstrip()), "saving looks changes what they do not concern"
    assert json.loads(saved)["looks"] == page.evaluate("window.studio.state.looks.looks")
    subprocess.run([program, "light-map", str(scene), "-q", "-o", str(scene.parent / "looks")], check=True, stdout=subprocess.DEVNULL)
    mine, theirs = shown(page), decoded(page, scene.parent / "looks/court_after.png")
    assert mine["stage"] == "full" and mine["bytes"] == theirs, "the command finds another picture of the looks"
    print("the looks of the page are those of the saved scene, to the bit")
    page.locator("#transfer-on").click()
    page.click("#edits .row:nth-child(1) button[title='Remove']")
    told(page, "looks.transfer === undefined && looks.occluders === undefined")
    until_done(page)
    page.click("#looks-section > summary")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--strokes", type=int, default=8)
    arguments.add_argument("--seconds", type=float, default=10)
    arguments.add_argument("--shots")
    asked = arguments.parse_args()
    chromium = next(path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name)))
    faults = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        scene = pathlib.Path(folder) / "citadel.json"
        document = json.loads((ROOT / "strokes/citadel.json").read_text())
        # The command and the studio show the pictures alike.
        document["exposure"] = 0
        scene.write_text(json.dumps(document, indent=2))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        studio = Studio(asked.program, scene)
        page = opened(browser, studio.address, faults)
        until_done(page)

        def shot(name):
            if asked.shots:
                page.screenshot(path=os.path.join(asked.shots, f"{name}.png"))

        shot("opened")
        began = count(page)
        paint(page, [(250, 240), (300, 260), (330, 300)])
        until_done(page)
        shot("painted")

        # Undo and redo by keys.
        page.keyboard.press("Control+z")
        until(page, "began => window.studio.state.strokes[0].length === began", began)
        page.keyboard.press("Control+Shift+Z")
        until(page, "began => window.studio.state.strokes[0].length === began + 1", began)
        until_done(page)

        # What is saved is solved by the command, and gives the same picture.
        page.keyboard.press("Control+s")
        until(page, "() => window.studio.state.isSaved")
        subprocess.run([asked.program, "light-map", str(scene), "-q", "-o", f"{folder}/command"], check=True, stdout=subprocess.DEVNULL)
        mine, theirs = shown(page), decoded(page, pathlib.Path(folder) / "command/court_after.png")
        assert mine["stage"] == "full" and mine["bytes"] == theirs, "the command finds another picture"
        print("the page shows what the command finds of the saved scene, to the bit")

        # Another tab, and a reload.
        other = opened(browser, studio.address, faults)
        paint(other, [(150, 180), (180, 175)])
        until(page, "began => window.studio.state.strokes[0].length === began + 2", began)
        other.context.close()
        page.reload()
        until(page, "began => window.studio?.state.strokes[0]?.length === began + 2", began)

        # A crash loses nothing.
        strokes = page.evaluate("window.studio.state.strokes")
        assert not faults, faults
        studio.end(signal.SIGKILL)
        until(page, "() => window.studio.state.socket === 'closed'")
        shot("lost")
        page.context.close()
        faults.clear()
        studio = Studio(asked.program, scene)
        page = opened(browser, studio.address, faults)
        assert page.evaluate("window.studio.state.strokes") == strokes, "strokes are lost"
        until_done(page)

        # How soon a stroke is seen.
        random.seed(7)
        took = []
        for _ in range(asked.strokes):
            x, y = random.uniform(150, 480), random.uniform(120, 300)
            paint(page, [(x, y), (x + random.uniform(-60, 60), y + random.uniform(-30, 30))])
            until(page, "() => window.studio.state.drawnRevision === window.studio.state.revision && window.studio.state.pending.length === 0")
            took.append(page.evaluate("window.studio.state.drawnAt - window.studio.state.strokeEndedAt"))
            page.wait_for_timeout(250)
        print(f"from the end of a stroke to its first picture: median {statistics.median(took):.0f} ms of {len(took)} ({min(took):.0f} to {max(took):.0f})")
        clock = time.time()
        paint(page, [(300, 250), (320, 260)])
        until_done(page)
        print(f"full resolution after {time.time() - clock:.1f} s")

        print(f"while a stroke is painted: {frames(page):.0f} frames a second")

        # A pen that is pressed more and more.
        began = count(page)
        press(page, [(260, 200), (300, 210), (340, 230)], [0.2, 0.6, 1])
        until(page, "began => window.studio.state.strokes[0].length === began + 1", began)
        pressure = page.evaluate("window.studio.state.strokes[0].at(-1).pressure")
        assert pressure and pressure[0] < 0.5 < pressure[-1], pressure

        # Groups: one that is hidden is as if it were not there.
        page.click("#add-group")
        page.keyboard.press("Enter")
        until(page, "() => window.studio.state.groups.length === 1")
        paint(page, [(200, 250), (240, 260)])
        name = page.evaluate("window.studio.state.groups[0].name")
        assert page.evaluate("window.studio.state.strokes[0].at(-1).group") == name
        shot("groups")

        # The light turns, and the fog thickens.
        look = page.evaluate("window.studio.state.look")
        page.focus("#sun")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        until(page, "before => window.studio.state.look.sun[0] !== before.sun[0]", look)
        page.focus("#fog")
        page.keyboard.press("ArrowRight")
        until(page, "before => window.studio.state.look.sigma_t > before.sigma_t", look)
        until_done(page)
        page.click("#numbers")
        until(page, "() => document.querySelector('#details').textContent.includes('Certificate')")
        shot("light")
        # What is over the picture is closed by a press beside it, which paints nothing, and by the keyboard.
        strokes = count(page)
        place = page.evaluate("window.studio.toScreen(320, 100)")
        page.mouse.click(place["x"], place["y"])
        assert page.evaluate("document.querySelector(':popover-open') === null"), "a press does not close the sheet"
        page.click("#numbers")
        page.keyboard.press("Escape")
        assert page.evaluate("document.querySelector(':popover-open') === null"), "Escape does not close the sheet"
        page.wait_for_timeout(300)
        assert count(page) == strokes, "a press that closes a sheet paints"

        looks(page, scene, asked.program, shot)

        # The wipe takes the picture along.
        page.keyboard.press("w")
        page.wait_for_timeout(200)
        seen = picture_drawn(page)
        for _ in range(15):
            page.keyboard.press("ArrowRight")
        page.wait_for_timeout(200)
        assert picture_drawn(page) != seen, "the picture does not follow the wipe"
        page.keyboard.press("w")

        # Another eye, that stays.
        views = page.evaluate("window.studio.state.views.length")
        fly(page)
        shot("free")
        page.click("#keep")
        page.keyboard.press("Enter")
        until(page, "views => window.studio.state.views.length === views + 1", views)
        until_done(page)
        page.keyboard.press("x")
        shot("kept")
        page.keyboard.press("x")
        page.keyboard.press("1")
        until(page, "() => window.studio.state.view === 0")

        # Whatever somebody does.
        before, middle, deeds, clock = studio.resident(), None, 0, time.time()
        while time.time() - clock < asked.seconds:
            if middle is None and time.time() - clock > asked.seconds / 2:
                middle = studio.resident()
            deed = random.random()
            if deed < 0.5:
                x, y = random.uniform(20, 620), random.uniform(20, 340)
                # It may also move the wipe, or reach for a colour.
                drag(page, [(x, y), (x + random.uniform(-80, 80), y + random.uniform(-40, 40))])
            elif deed < 0.53:
                fly(page)
                page.keyboard.press("Escape")
            elif deed < 0.78:
                page.keyboard.press(random.choice(["Control+z", "Control+Shift+Z"]))
            else:
                page.keyboard.press(random.choice(["o", "r", "w", "[", "]", "+", "-", "0", "Tab", "Tab", "l", "l"]))
                page.keyboard.press("0")
            deeds += 1
            page.wait_for_timeout(50)
        page.wait_for_timeout(500)
        print(f"{deeds} deeds in {asked.seconds:.0f} s: the studio has {studio.resident():.0f} MiB, {middle:.0f} half-way, {before:.0f} before")
        shot("after")
        assert not faults, faults
        assert studio.end() in (0, 130)
        browser.close()
    print("the studio holds")


main()
