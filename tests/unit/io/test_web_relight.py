"""The relighting page: what its script draws in a browser is the library's own picture, byte by byte."""

import base64
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from psstereo.errors import ExistingResultError, OptionError
from psstereo.forward.polynomial_maps import relit_picture
from psstereo.io.rti_planes import TERMS, RelightPlanes, quantised_planes
from psstereo.io.web_relight import write_web_relight

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def planes_of(basis: str, channels: int, *, coloured: bool = False) -> RelightPlanes:
    """Random planes; those of the constant term lead the rest, so that pictures are neither black nor white."""
    random = np.random.default_rng(5)
    coefficients = 0.3 * random.standard_normal((TERMS[basis], 21, 34, channels))
    coefficients[5 if basis == "ptm" else 0] += 0.8
    colour = random.integers(0, 256, (21, 34, 3)).astype(np.uint8) if coloured else None
    return quantised_planes(coefficients, basis, colour=colour)


class Addresses(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        self.found += [value for key, value in attributes if key in ("src", "href")]


def test_the_folder_stands_alone_and_says_how_planes_are_read(tmp_path):
    planes = planes_of("ptm", 1, coloured=True)
    write_web_relight(tmp_path / "web", planes, title="a <b> & $c")
    assert sorted(p.name for p in (tmp_path / "web").iterdir()) == [
        "index.html",
        "info.json",
        "plane_0.png",
        "plane_1.png",
        "plane_2.png",
    ]
    page = (tmp_path / "web" / "index.html").read_text(encoding="utf-8")
    outline = Addresses()
    outline.feed(page)
    assert outline.found == []
    assert "http" not in page
    assert "<title>a &lt;b&gt; &amp; $c</title>" in page
    # by info.json and the pictures alone: r g b, 1, u, v, u², u v, v², value = (byte / 255 − bias) · scale
    info = json.loads((tmp_path / "web" / "info.json").read_text(encoding="utf-8"))
    stack = [cv2.imread(str(tmp_path / "web" / f"plane_{i}.png"))[..., ::-1] for i in range(3)]
    codes = np.concatenate(stack, axis=-1)
    material = info["materials"][0]
    values = (codes / 255.0 - np.array(material["bias"])) * np.array(material["scale"])
    x, y = 0.3, -0.4
    brightness = values[..., 3:] @ np.array([1, x, y, x * x, x * y, y * y])
    shown = np.floor(np.clip(255 * brightness[..., None] * values[..., :3], 0, 255) + 0.5)
    np.testing.assert_array_equal(shown, relit_picture(planes, (x, y, np.sqrt(1 - x * x - y * y))))
    assert (info["width"], info["height"], info["nplanes"], info["type"]) == (34, 21, 9, "ptm")


def test_what_is_in_the_way_stays(tmp_path):
    planes = planes_of("hsh4", 3)
    write_web_relight(tmp_path / "web", planes)
    with pytest.raises(ExistingResultError, match="--overwrite"):
        write_web_relight(tmp_path / "web", planes)
    write_web_relight(tmp_path / "web", planes, overwrite=True)
    (tmp_path / "web" / "mine.txt").write_text("x")
    with pytest.raises(ExistingResultError, match="mine"):
        write_web_relight(tmp_path / "web", planes, overwrite=True)
    with pytest.raises(OptionError, match="quality"):
        write_web_relight(tmp_path / "other", planes, quality=0)
    assert not (tmp_path / "other").exists()


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_a_browser_shows_the_same_bytes(tmp_path):
    # All kinds of planes in one page load: each page is drawn in a frame of its own by its own script.
    kinds = {
        "lrgb": planes_of("ptm", 1, coloured=True),
        "rgb": planes_of("ptm", 3),
        "gray": planes_of("hsh4", 1),
        "hsh": planes_of("hsh9", 3),
    }
    probe = """<script>
    (async function () {
      while (!document.body.dataset.ready) await new Promise(done => setTimeout(done, 5));
      const canvas = document.getElementById("surface"), box = canvas.getBoundingClientRect(), told = [];
      for (const [across, down] of [[0.5, 0.5], [0.61, 0.27], [0.02, 0.9]]) {
        canvas.dispatchEvent(new PointerEvent("pointermove",
          {clientX: box.left + across * box.width, clientY: box.top + down * box.height}));
        told.push(canvas.dataset.light + "|" + canvas.toDataURL());
      }
      parent.postMessage(NAME + "|" + told.join("|"), "*");
    })();
    </script></body>"""
    frames = ""
    for name, planes in kinds.items():
        write_web_relight(tmp_path / name, planes)
        page = (tmp_path / name / "index.html").read_text(encoding="utf-8")
        page = page.replace("</body>", probe.replace("NAME", json.dumps(name)))
        (tmp_path / f"{name}.html").write_text(page, encoding="utf-8")
        frames += f'<iframe src="{name}.html" width="400" height="300"></iframe>'
    listen = """<script>onmessage = event => {
      const one = document.createElement("pre"); one.textContent = event.data; document.body.append(one); };</script>"""
    outer = tmp_path / "all é.html"
    outer.write_text(f'<meta charset="utf-8"><body>{listen}{frames}</body>', encoding="utf-8")
    quiet = ["--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-sync"]
    command = [BROWSER, "--headless", "--no-sandbox", *quiet, "--disable-component-update"]
    done = subprocess.run(
        [
            *command,
            "--virtual-time-budget=5000",
            f"--user-data-dir={tmp_path / 'profile'}",
            "--dump-dom",
            outer.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    told = {block.split("|")[0]: block.split("|")[1:] for block in re.findall(r"<pre>([^<]*)</pre>", done.stdout)}
    assert set(told) == set(kinds)
    for name, planes in kinds.items():
        lights = [np.array([float(part) for part in text.split(",")]) for text in told[name][::2]]
        assert len(lights) == 3
        np.testing.assert_allclose(lights[0], [0, 0, 1], atol=1e-12)
        assert lights[1][0] > 0.1
        assert lights[1][1] > 0.1
        assert lights[2][2] < 0.3  # near the rim
        for light, address in zip(lights, told[name][1::2], strict=True):
            data = base64.b64decode(address.split(",")[1])
            shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
            expected = relit_picture(planes, light)
            assert 20 < expected.mean() < 235
            np.testing.assert_array_equal(shown, np.broadcast_to(expected, shown.shape))
