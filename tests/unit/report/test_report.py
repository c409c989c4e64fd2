"""The report: complete in itself, honest about everything it was given, and alive in a browser."""

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from psstereo.depth import Poisson
from psstereo.metrics import angular_error
from psstereo.normals import LeastSquares
from psstereo.normals.estimate import solve_gathered
from psstereo.normals.gathered import gathered
from psstereo.report import Report, render_report, views_of
from psstereo.report.relight import relit
from psstereo.results import Step
from psstereo_synth.problems import solver_problems

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def report():
    capture, truth = solver_problems(64, 48, 8)[0].make()
    with gathered(capture) as samples:
        normals = solve_gathered(samples, LeastSquares())
        views = views_of(samples, normals, side=32)
    return Report(
        name="a <b> & c",
        summary="Eight images.",
        normals=normals,
        depth=Poisson().integrate(normals.normals, capture.camera, mask=capture.mask),
        steps=[
            Step(name="reading", done=True, reason="8 images.", seconds=0.25),
            Step(name="<script>alert(1)</script>", done=False, reason="Not needed."),
        ],
        findings=[{"name": "gamma", "severity": "fault", "figure": "2.2", "sentence": "Bent.", "remedy": "Undo it."}],
        directions=capture.rig.directions,
        names=capture.stack.names,
        views=views,
        errors=angular_error(normals.normals, truth.normals),
    )


class Outline(HTMLParser):
    """Takes a page apart and complains where tags do not match."""

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.identities = [], [], []

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.addresses += [found[key] for key in ("src", "href") if key in found]
        self.identities += [found["id"]] if "id" in found else []
        if tag not in {"meta", "img", "br", "circle"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag != "circle":
            assert self.open.pop() == tag


def test_the_page_is_complete_in_itself(report):
    page = render_report(report)
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert outline.addresses
    assert all(address.startswith("data:image/png;base64,") for address in outline.addresses)
    assert "http" not in page
    assert {"plan", "diagnosis", "relight", "pictures", "flags", "images"} <= set(outline.identities)
    assert {f"picture-{key}" for key in ("normals", "albedo", "depth", "errors", "residual")} <= set(outline.identities)


def test_what_was_given_is_shown_and_escaped(report):
    page = render_report(report)
    assert "a &lt;b&gt; &amp; c" in page
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert 'class="fault">gamma' in page
    assert page.count("<title>") == 1 + len(report.names)


def test_what_is_missing_is_left_out(report):
    bare = Report(name="n", summary="s", normals=report.normals)
    page = render_report(bare)
    assert 'id="diagnosis"' not in page
    assert 'id="images"' not in page
    assert 'id="picture-depth"' not in page


def test_pictures_are_those_of_the_arrays(report):
    page = render_report(report)
    source = re.search(r'id="picture-normals"[^>]*src="data:image/png;base64,([^"]+)"', page)
    shown = cv2.imdecode(np.frombuffer(base64.b64decode(source[1]), np.uint8), cv2.IMREAD_UNCHANGED)[..., [2, 1, 0, 3]]
    known = np.isfinite(report.normals.normals).all(axis=-1)
    np.testing.assert_array_equal(shown[..., 3] == 255, known)
    np.testing.assert_allclose(shown[known][:, :3] / 127.5 - 1, report.normals.normals[known], atol=0.5 / 127.5 + 1e-6)


def test_residuals_are_small_on_a_matte_surface_and_thumbnails_are_the_images(report):
    assert np.nanmedian(report.views.residual) < 0.01
    assert report.views.images.shape[0] == len(report.names)
    assert np.nanmax(report.views.images) > 0


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_the_pointer_moves_the_sun(report, tmp_path):
    # The page's own script is driven by an event, and what the canvas shows is read back as a picture.
    probe = """<script>
    const canvas = document.getElementById("surface"), box = canvas.getBoundingClientRect();
    document.body.dataset.before = canvas.toDataURL();
    canvas.dispatchEvent(new PointerEvent("pointermove",
      {clientX: box.left + 0.75 * box.width, clientY: box.top + 0.3 * box.height}));
    document.body.dataset.after = canvas.toDataURL();
    document.body.dataset.light = canvas.dataset.light;
    </script></body>"""
    page = tmp_path / "report é.html"
    page.write_text(render_report(replace(report, views=None)).replace("</body>", probe), encoding="utf-8")
    quiet = ["--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-sync"]
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        *quiet,
        "--disable-component-update",
        "--virtual-time-budget=3000",
    ]
    done = subprocess.run(
        [*command, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    body = re.search(r"<body[^>]*>", done.stdout)[0]
    light = np.array([float(part) for part in re.search(r'data-light="([^"]+)"', body)[1].split(",")])
    normals, albedo = report.normals.normals, report.normals.albedo
    for key, direction in (("before", np.array([0.0, 0.0, 1.0])), ("after", light)):
        data = base64.b64decode(re.search(rf'data-{key}="data:image/png;base64,([^"]+)"', body)[1])
        shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(int)
        expected = relit(normals, albedo, direction).astype(int)
        assert np.abs(shown - expected).max() <= 2  # a table of 4096 steps there, exact powers here
    assert light[0] > 0.3
    assert light[1] > 0.2
    assert np.linalg.norm(light) == pytest.approx(1.0, abs=1e-5)
