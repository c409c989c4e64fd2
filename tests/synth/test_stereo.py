import numpy as np
import pytest

from psstereo.brdf import Phong
from psstereo.camera import Orthographic, Pinhole, Pose
from psstereo.errors import InputError, UnsupportedError
from psstereo.lights import Directional
from psstereo.matching import CalibratedView, covisible
from psstereo_synth.faults import Flicker
from psstereo_synth.patterns import Constant
from psstereo_synth.rendering import render
from psstereo_synth.scenes import Material, Scene, Viewpoint
from psstereo_synth.sensor import Sensor
from psstereo_synth.shapes import GaussianHills, Plane
from psstereo_synth.stereo import same_points, side_by_side, true_disparity

SIZE = (40, 48)


def rig(**changes):
    scene = Scene(
        name="rig",
        surface=GaussianHills(steepness=1.5),
        viewpoints=side_by_side(SIZE, focal=90.0, distance=4.0, baseline=1.0),
        size=SIZE,
        lights=tuple(Directional(direction=np.array([x, 0.2, 1.0]), strength=np.ones(1)) for x in (-0.5, 0.5)),
    )
    return scene.changed(**changes)


def test_disparity_of_a_plane_is_focal_baseline_over_distance():
    found = true_disparity(rig(surface=Plane(slope_x=0.0, slope_y=0.0)))
    assert found.visible.sum() > 0.4 * found.visible.size
    np.testing.assert_allclose(found.disparity[np.isfinite(found.disparity)], 90.0 * 1.0 / 4.0, atol=1e-9)


def test_disparity_follows_from_the_rendered_depth():
    scene = rig()
    found, shots = true_disparity(scene), render(scene)
    np.testing.assert_allclose(found.disparity, 90.0 / shots[0].truth.depth, atol=1e-9)
    views = [CalibratedView(camera=v.camera, pose=v.pose) for v in scene.viewpoints]
    depths = [shot.truth.depth for shot in shots]
    _, _, seen = covisible(depths[0], *views, SIZE, other_depth=depths[1], tolerance=0.02)
    assert (seen == found.visible).mean() > 0.98


def test_a_shift_of_the_principal_points_is_taken_off_the_disparity():
    pair = side_by_side(SIZE, focal=90.0, distance=4.0, baseline=1.0, shift=7.0)
    plain, moved = true_disparity(rig()), true_disparity(rig(viewpoints=pair))
    assert np.nanmedian(plain.disparity) - np.nanmedian(moved.disparity) == pytest.approx(14, abs=0.5)


def test_matte_points_have_the_same_value_from_both_places():
    found = same_points(rig())
    assert len(found.points) > 500
    np.testing.assert_array_equal(found.first, found.second)
    np.testing.assert_allclose(found.radiance[0], found.radiance[1], rtol=1e-12)
    assert found.image(found.first).shape == (2, 1, *SIZE)
    assert found.mask.sum() == len(found.points)


def test_the_first_view_is_the_photograph_itself():
    scene = rig(sensor=Sensor(bits=16, white=0.5))
    found, shot = same_points(scene), render(scene)[0]
    frame = shot.capture.stack.frame(1)
    rows, columns = found.pixels.T
    np.testing.assert_array_equal(found.first[1], frame[rows, columns])


def test_glossy_points_have_not():
    parameters = {"specular": np.array([0.3]), "exponent": np.array([40.0])}
    glossy = Material(model=Phong, parameters=parameters, albedo=Constant(albedo=[0.5]))
    found = same_points(rig(material=glossy))
    assert np.abs(found.first - found.second).max() > 0.05 * found.white_value


def test_noise_is_another_in_the_other_photograph():
    found = same_points(rig(sensor=Sensor(bits=12, white=0.5, full_well=5000.0)))
    assert (found.first != found.second).mean() > 0.9


def test_what_is_no_pair_is_refused():
    with pytest.raises(InputError):
        side_by_side(SIZE, focal=90.0, distance=4.0, baseline=0.0)
    left, right = side_by_side(SIZE, focal=90.0, distance=4.0, baseline=1.0)
    with pytest.raises(UnsupportedError, match="not rectified"):
        true_disparity(rig(viewpoints=(right, left)))
    turned = Viewpoint(camera=right.camera, pose=Pose.looking_at(right.pose.position, np.zeros(3)))
    with pytest.raises(UnsupportedError, match="not rectified"):
        true_disparity(rig(viewpoints=(left, turned)))
    away = Viewpoint(
        camera=Pinhole(fx=400.0, fy=400.0, cx=24.0, cy=20.0), pose=Pose.looking_at([0.8, 0.0, 4.0], [0.8, 0.0, 0.0])
    )
    other = Viewpoint(camera=away.camera, pose=Pose.looking_at([-0.8, 0.0, 4.0], [-0.8, 0.0, 0.0]))
    with pytest.raises(InputError, match="share no point"):
        same_points(rig(viewpoints=(away, other)))
    flat = Viewpoint(camera=Orthographic(pixel_size=0.04), pose=Pose(position=np.array([-0.9, 0.8, 0.0])))
    with pytest.raises(UnsupportedError, match="Pinholes"):
        same_points(rig(viewpoints=(left, flat)))
    with pytest.raises(UnsupportedError, match="faults"):
        same_points(rig(faults=(Flicker(),)))
