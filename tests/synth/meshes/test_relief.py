import numpy as np
import pytest

from psstereo.errors import InputError
from psstereo_synth.meshes import mesh_of_relief, view_mesh_rays
from psstereo_synth.shapes import GaussianHills, Ripples, Sphere
from psstereo_synth.view import centred_orthographic, centred_pinhole, view_relief


@pytest.mark.parametrize("relief", [GaussianHills(), Ripples()], ids=["hills", "ripples"])
@pytest.mark.parametrize("central", [False, True])
def test_the_mesh_tends_to_the_relief_that_it_was_made_from(relief, central):
    """Heights and interpolated normals of a mesh are of second order in its cells, seen by either camera."""
    camera, pose = (
        centred_pinhole((40, 40), focal=80.0, distance=6.0) if central else centred_orthographic((40, 40), width=2.87)
    )
    truth = view_relief(relief, camera, pose, (40, 40), scale=1.5)
    errors = []
    for n in (81, 161, 321):
        view = view_mesh_rays(mesh_of_relief(relief, n, scale=1.5), camera, pose, (40, 40))
        both = truth.geometry.mask & view.geometry.mask
        assert np.count_nonzero(both) > 0.95 * np.count_nonzero(truth.geometry.mask)
        turned = np.abs(view.normals() - truth.normals())[both]
        errors.append([np.abs(view.depth - truth.depth)[both].mean(), turned.mean()])
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.6).all()
    assert max(errors[-1]) < 2e-3


def test_an_infinite_slope_leaves_normals_to_the_triangles():
    mesh = mesh_of_relief(Sphere(radius=0.5), 41)
    assert mesh.smooth
    normals = mesh.smooth_normals[np.unique(mesh.faces)]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-12)
    assert (mesh.face_normals[:, 2] > 0).all()
    flat = mesh_of_relief(Ripples(), 41, smooth=False)
    assert not flat.smooth
    assert flat.vertex_normals is None


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scales_that_mean_nothing_are_refused(scale):
    with pytest.raises(InputError, match="scaled"):
        mesh_of_relief(Ripples(), 20, scale=scale)
