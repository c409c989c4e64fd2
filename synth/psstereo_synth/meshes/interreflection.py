"""One bounce of light between the parts of a matte mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.errors import InputError
from psstereo.forward.geometry import Geometry
from psstereo.types import FloatArray
from psstereo_synth.meshes.rays import RayCaster

__all__ = ["Gather"]

_RAYS = 1 << 20


@dataclass(frozen=True, kw_only=True, eq=False)
class Gather:
    """Which triangles each point of a surface sees, and how much of its sky each of them takes.

    The light that arrives over another part of the surface is ``E = Σ F B``, with B the radiosity [W m⁻²] that a
    triangle sends out (albedo times its own direct irradiance) and F the share of the cosine-weighted hemisphere that
    it fills [1]_. The shares depend on the shape alone: work them out once, for all lights.

    They are counted over directions with the density cos/π, a Hammersley set that is shifted for each point [2]_. The
    error of a share f is below that of as many independent directions, √(f (1 − f) / samples). Radiosity is one number
    a triangle, so triangles must be small against what light does on them. Only the first bounce is there: in a deep
    hollow of albedo a the second would add about a times the first. Not for mirrors and gloss.

    Attributes
    ----------
    transport : scipy.sparse.csr_array, float64 (p, f)
        The shares F [1].

    References
    ----------
    .. [1] C. M. Goral, K. E. Torrance, D. P. Greenberg, B. Battaile, "Modeling the interaction of light between diffuse
       surfaces", SIGGRAPH 1984. doi:10.1145/800031.808601
    .. [2] R. Cranley, T. N. L. Patterson, "Randomization of Number Theoretic Methods for Multiple Integration", SIAM
       Journal on Numerical Analysis 13, 1976. doi:10.1137/0713071
    """

    transport: Any

    @classmethod
    def prepare(cls, geometry: Geometry, caster: RayCaster, *, samples: int = 256, seed: int = 0) -> "Gather":
        """Cast the rays.

        Parameters
        ----------
        geometry : Geometry
            Points and normals, in the frame of the mesh.
        caster : RayCaster
            The mesh that sends out light: of each triangle the side that its corners run counter-clockwise on. The
            other side is dark.
        samples : int
            Directions for each point; memory is at most 12 · samples bytes a point, and some 200 MB beside it [1].
        seed : int
            The same seed gives the same directions, whatever the number of points after a point.

        Returns
        -------
        Gather
            The shares.

        Raises
        ------
        InputError
            If there is not at least one direction.
        """
        from scipy import sparse

        if samples < 1:
            raise InputError(
                given=f"{samples} directions are asked for.",
                needed="At least one, some hundreds for a smooth result.",
                remedy="Give a larger number of samples.",
            )
        points, normals = geometry.points, geometry.normals
        starts, faces = caster.lifted(points, normals), len(caster.mesh.faces)
        shifts = np.random.default_rng(seed).random((len(points), 2))
        block = max(1, _RAYS // samples)
        parts = [sparse.csr_array((0, faces))]
        for first in range(0, len(points), block):
            rows = slice(first, first + block)
            parts.append(_shares(caster, starts[rows], _directions(normals[rows], shifts[rows], samples)))
        return cls(transport=sparse.vstack(parts, format="csr"))

    def irradiance(self, radiosity: FloatArray) -> FloatArray:
        """Return what arrives at the points from the triangles.

        Parameters
        ----------
        radiosity : float array (f, c)
            Sent out by each triangle's front, albedo · irradiance; columns may be channels, or channels of many
            lights side by side [W m⁻²].

        Returns
        -------
        float64 array (p, c)
            Irradiance [W m⁻²].

        Raises
        ------
        InputError
            If there is not one row for each triangle, or a radiosity is negative or not finite.
        """
        b = np.asarray(radiosity, np.float64)
        fits = b.ndim == 2 and len(b) == self.transport.shape[1]
        if not fits or not (np.isfinite(b).all() and (b >= 0).all()):
            raise InputError(
                given=f"The radiosities have the shape {b.shape} for {self.transport.shape[1]} triangles.",
                needed="A row of finite numbers, zero or more, for each triangle.",
                remedy="Give albedo times irradiance at mesh.centres; triangles without area need zeros.",
            )
        return np.asarray(self.transport @ b)

    @property
    def seen(self) -> FloatArray:
        """Share of each point's sky that the mesh fills with light-sending sides, float64 (p,) [1]."""
        return np.asarray(self.transport.sum(axis=1)).reshape(-1)


def _shares(caster: RayCaster, starts: FloatArray, directions: FloatArray) -> Any:
    from scipy import sparse

    count, samples = directions.shape[:2]
    flat = directions.reshape(-1, 3)
    hits = caster.faces_hit(np.repeat(starts, samples, axis=0), flat)
    facing = (caster.mesh.face_normals[hits] * flat).sum(axis=1) < 0
    use = (hits >= 0) & facing
    start = np.concatenate([[0], np.cumsum(np.count_nonzero(use.reshape(count, samples), axis=1))])
    share = np.full(np.count_nonzero(use), 1.0 / samples)
    matrix = sparse.csr_array((share, hits[use].astype(np.int32), start), shape=(count, len(caster.mesh.faces)))
    matrix.sum_duplicates()
    return matrix


def _directions(normals: FloatArray, shifts: FloatArray, samples: int) -> FloatArray:
    """Return directions (p, samples, 3) around the normals with the density cos/π."""
    number = np.arange(samples, dtype=np.uint32)
    plan = np.stack([(number + 0.5) / samples, _mirrored(number)], axis=1)
    u = (plan + shifts[:, None]) % 1.0
    radius, angle = np.sqrt(u[..., 0]), 2 * np.pi * u[..., 1]
    across, along = _tangents(normals)
    flat = (radius * np.cos(angle))[..., None] * across[:, None] + (radius * np.sin(angle))[..., None] * along[:, None]
    return np.asarray(flat + np.sqrt(1 - u[..., 0])[..., None] * normals[:, None])


def _mirrored(number: FloatArray | Any) -> FloatArray:
    """Return the van der Corput sequence: the bits of a 32-bit number behind the point, last first."""
    n = np.array(number, np.uint32)
    for step, mask in ((16, 0x0000FFFF), (8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        n = ((n & np.uint32(mask)) << np.uint32(step)) | ((n >> np.uint32(step)) & np.uint32(mask))
    return np.asarray(n / 2.0**32)


def _tangents(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors across each normal and each other."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]  # the axis farthest from the normal
    across = np.cross(axis, normals)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(normals, across)
