"""The same surface from several viewpoints."""

import numpy as np

from psstereo.brdf import Brdf, Ggx, Lambert
from psstereo.camera import Pinhole, Pose
from psstereo.lights import Directional
from psstereo.types import FloatArray
from psstereo_synth.lecture.dome import dome, photograph
from psstereo_synth.lecture.example import Example, largest_of, largest_relative
from psstereo_synth.lecture.statements import STATEMENTS
from psstereo_synth.patterns import Checker
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import GaussianHills

__all__ = ["same_points", "viewpoints"]

_TILTS = (0.0, 20.0, 40.0, 60.0, 80.0, -20.0, -40.0, -60.0, -80.0)
"""Of the eye to the patch's normal; the light stands at 40°, so its mirror direction is −40° [deg]."""
_LEFT, _RIGHT = np.array([-3.0, 0.0, 6.0]), np.array([3.0, 1.0, 6.0])
"""Where the two cameras stand over painted hills [length]."""
_GLOSS = {"f0": np.array([0.05]), "roughness": np.array([0.3])}
_SIZE = (7, 9)
"""Rows and columns of the left camera's image."""
_SPOT = (3, 3)
"""Size of an image of the right camera, which looks at one point at a time with its middle pixel."""


def _camera(position: FloatArray, target: FloatArray, size: tuple[int, int]) -> Viewpoint:
    camera = Pinhole(fx=24.0, fy=24.0, cx=0.5 * (size[1] - 1), cy=0.5 * (size[0] - 1))
    return Viewpoint(camera=camera, pose=Pose.looking_at(position, target))


def same_points(model: type[Brdf]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Photograph hills from the left, and then each point that was seen from the right.

    Parameters
    ----------
    model : type of Brdf
        `Lambert` for matte paint, `Ggx` for glossy paint.

    Returns
    -------
    points : float64 array (p, 3)
        The points that both cameras see [length].
    left, right : float64 array (p,)
        Their radiance [W m⁻² sr⁻¹].
    """
    scene = Scene(
        name="hills",
        surface=GaussianHills(),
        material=Material(
            model=model, parameters=_GLOSS if model is Ggx else {}, albedo=Checker(cells=7, low=[0.3], high=[0.7])
        ),
        viewpoints=(_camera(_LEFT, np.zeros(3), _SIZE),),
        size=_SIZE,
        lights=(Directional(direction=dome(30.0, 75.0), strength=np.array([1000.0])),),
        cast_shadows=False,
        sensor=Sensor(bits=None, white=1.0),
    )
    shot = render(scene)[0]
    points = shot.view.geometry.points
    left = np.asarray(shot.capture.stack.frame(0)[shot.view.geometry.mask, 0])
    aimed = render(scene.changed(size=_SPOT, viewpoints=tuple(_camera(_RIGHT, p, _SPOT) for p in points)))
    middle = tuple(n // 2 for n in _SPOT)
    right = np.array([spot.capture.stack.frame(0)[middle][0] for spot in aimed])
    met = [spot.view.depth[middle] for spot in aimed]
    # A hill in front hides the point: then the ray meets something nearer.
    both = np.abs(np.array(met) - np.linalg.norm(points - _RIGHT, axis=-1)) < 1e-9
    return points[both], left[both], right[both]


def viewpoints() -> Example:
    """Look at a matte and at a glossy surface from several places: one flat patch, and then a whole landscape.

    *Statement.* A matte surface sends out L = ρ E, the same in every direction. E is the light's doing; the eye does
    not enter. Aslant a patch looks smaller, and sends less *power* to the eye in the same proportion: the brightness,
    power per area seen, stays. So two cameras see the same brightness at the same point, which is what stereo matching
    lives on.

    *Where it stops being true.* A glossy surface has a highlight, which stands where the mirror direction is, and so
    moves with the eye. Paper, plaster and cloth are matte up to some 60° and darker or lighter beyond. And what one
    of the cameras does not see, behind a hill, cannot be compared.

    Returns
    -------
    Example
        The error is the largest relative difference of the matte surface between viewpoints. The example holds only if
        the glossy one differs by more than a tenth, on the patch and on the hills.
    """
    eyes = [dome(tilt, 0.0) for tilt in _TILTS]
    light = [dome(40.0, 0.0)]
    matte = photograph(Lambert(albedo=np.array([0.6])), light, eyes)[0]
    glossy = photograph(Ggx(albedo=np.array([0.6]), **_GLOSS), light, eyes)[0]
    points, *matte_pair = same_points(Lambert)
    glossy_pair = same_points(Ggx)[1:]
    matte_scene, glossy_scene = largest_relative(*matte_pair), largest_relative(*glossy_pair)
    rows: list[tuple[str, float, float]] = [
        (f"patch from {tilt:g}° [W m⁻² sr⁻¹]", float(a), float(b))
        for tilt, a, b in zip(_TILTS, matte, glossy, strict=True)
    ]
    matte_patch, glossy_patch = largest_relative(matte, matte[0]), largest_relative(glossy, glossy[0])
    rows.append(("patch, largest difference [1]", matte_patch, glossy_patch))
    rows.append(("hills, two cameras, largest difference [1]", matte_scene, glossy_scene))
    error, tolerance = largest_of(matte_patch, matte_scene), 1e-11
    return Example(
        title="Several viewpoints",
        statement=STATEMENTS["viewpoints"],
        columns=("what", "matte", "glossy"),
        rows=tuple(rows),
        largest_error=error,
        tolerance=tolerance,
        holds=error <= tolerance and min(glossy_patch, glossy_scene) > 0.1,
        notes=(f"The hills are compared at {len(points)} points that both cameras see.",),
    )
