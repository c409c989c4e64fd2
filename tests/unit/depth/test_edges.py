import numpy as np
import pytest

from psstereo.camera import Orthographic, Pinhole
from psstereo.depth.domain import make_domain
from psstereo.depth.edges import components_of, edge_steps
from psstereo.depth.laplacian import edge_laplacian
from psstereo.depth.poisson import Poisson
from psstereo.errors import OptionError

PINHOLE = Pinhole(fx=100.0, fy=100.0, cx=4.0, cy=3.0)


def domain(normals, camera=None, mask=None, weights=None):
    return make_domain(np.asarray(normals, float), camera or Orthographic(), mask, weights)


def test_signs_of_the_steps():
    slope = domain(np.broadcast_to([-1.0, 0.0, 1.0], (2, 2, 3)))  # leans to the left: rises to the right
    assert edge_steps(slope).right == pytest.approx(1.0)
    assert edge_steps(slope).down == pytest.approx(0.0)
    slope = domain(np.broadcast_to([0.0, -1.0, 1.0], (2, 2, 3)))  # leans down: rises upward, falls along the rows
    assert edge_steps(slope).down == pytest.approx(-1.0)
    slope = domain(np.broadcast_to([-1.0, 0.0, 1.0], (2, 2, 3)), PINHOLE)
    assert (edge_steps(slope).right < 0).all()  # rises toward the camera: the distance falls


def test_slant_takes_weight_away():
    flat = edge_steps(domain(np.broadcast_to([0.0, 0.0, 1.0], (2, 3, 3))))
    assert (flat.right_weight == 1.0).all()
    steep = domain(np.broadcast_to([0.0, np.sqrt(3.0), 1.0], (2, 3, 3)))
    assert edge_steps(steep).down_weight == pytest.approx(0.25)
    assert (edge_steps(steep, slant_exponent=0.0).down_weight == 1.0).all()


@pytest.mark.parametrize("tilt", [1e-1, 1e-3, 1e-5, 1e-7])
def test_the_energy_of_an_edge_is_bounded_however_steep(tilt):
    steps = edge_steps(domain(np.broadcast_to([-1.0, 0.0, tilt], (2, 2, 3))))
    assert steps.right == pytest.approx(1.0 / tilt)
    assert (steps.right_weight * steps.right**2 <= 1.0).all()


def test_weights_of_pixels_combine_to_their_harmonic_mean():
    weights = np.array([[1.0, 4.0, 4.0]])
    steps = edge_steps(domain(np.broadcast_to([0.0, 0.0, 1.0], (1, 3, 3)), weights=weights))
    assert steps.right_weight.tolist() == [[0.4, 1.0]]


def test_edges_beyond_sense_are_counted_and_cut_the_domain():
    normals = np.zeros((1, 4, 3))
    normals[..., 2] = 1.0
    normals[0, 2] = (1.0, 0.0, 1e-12)
    normals[0, 3] = (1.0, 0.0, 1e-12)
    cut = domain(normals)
    steps = edge_steps(cut)
    assert steps.left_out == 1
    assert steps.count == 2
    assert components_of(steps, cut.inside).tolist() == [[1, 1, 1, 2]]


def test_gradient_and_divergence_are_adjoint():
    """⟨G s, W c⟩ = ⟨s, b⟩ and ⟨G s, W G t⟩ = ⟨s, L t⟩ for any s, t."""
    rng = np.random.default_rng(8)
    mask = rng.random((13, 17)) < 0.7
    normals = rng.normal(size=(13, 17, 3)) * [1, 1, 0] + [0, 0, 1]
    part = domain(normals, mask=mask, weights=rng.random((13, 17)) + 0.1)
    steps = edge_steps(part)
    matrix, right_side = edge_laplacian(steps, part.inside)
    s, t = np.zeros((2, *part.inside.shape))
    s[part.inside], t[part.inside] = rng.normal(size=(2, int(part.inside.sum())))
    weight = np.concatenate([steps.right_weight.ravel(), steps.down_weight.ravel()])
    step = np.concatenate([steps.right.ravel(), steps.down.ravel()])

    def gradient(values):
        return np.concatenate([np.diff(values, axis=1).ravel(), np.diff(values, axis=0).ravel()])

    assert gradient(s) @ (weight * step) == pytest.approx(s[part.inside] @ right_side, rel=1e-12)
    assert gradient(s) @ (weight * gradient(t)) == pytest.approx(s[part.inside] @ (matrix @ t[part.inside]), rel=1e-12)


def test_the_domain_is_cut_to_its_bounding_rectangle():
    mask = np.zeros((9, 12), bool)
    mask[3:6, 4:9] = True
    cut = domain(np.broadcast_to([0.0, 0.0, 2.0], (9, 12, 3)), mask=mask)
    assert cut.inside.shape == (3, 5)
    assert cut.window == (slice(3, 6), slice(4, 9))
    np.testing.assert_array_equal(cut.normals, np.broadcast_to([0.0, 0.0, 1.0], (3, 5, 3)))


@pytest.mark.parametrize(
    "options",
    [{"tolerance": 0.0}, {"tolerance": np.nan}, {"max_iterations": 0}, {"threads": 0}, {"slant_exponent": -1.0}],
)
def test_options_without_sense_are_refused(options):
    with pytest.raises(OptionError, match="Leave them out"):
        Poisson(**options)


def test_a_range_that_no_float_holds_is_left_out_and_counted():
    normals = np.broadcast_to([0.99999, 0.0, 0.005], (3, 900, 3))
    result = Poisson().integrate(normals, Pinhole(fx=190.0, fy=190.0, cx=890.0, cy=1.0))
    finite = result.depth[np.isfinite(result.depth)]
    assert (finite > 0).all()
    assert result.facts["left_out"]["beyond_range"] == np.count_nonzero(result.components == 0) - sum(
        result.facts["left_out"][reason] for reason in ("no_normal", "facing_away", "zero_weight")
    )
