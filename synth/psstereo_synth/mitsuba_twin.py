"""The same scene in Mitsuba 3, an independent renderer, in absolute units: to check the forward model against it [1]_.

Mitsuba is no dependency; it comes with the ``test`` extra.

References
----------
.. [1] W. Jakob, S. Speierer, N. Roussel, M. Nimier-David, D. Vicini, T. Zeltner, B. Nicolet, M. Crespo, V. Leroy,
   Z. Zhang, "Mitsuba 3 renderer", 2022. https://mitsuba-renderer.org
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from psstereo.brdf import Lambert
from psstereo.camera import Orthographic, Pinhole
from psstereo.errors import UnsupportedError
from psstereo.lights import Ambient, Directional, Disc, Led, Light
from psstereo.types import FloatArray
from psstereo_synth.meshes import TriangleMesh
from psstereo_synth.patterns import Constant
from psstereo_synth.scenes import Scene
from psstereo_synth.shapes import Relief, Sphere

__all__ = ["MitsubaTwin", "Radiance"]

_LUMINANCE = 4
"""Channel of the luminance Y in a picture with moments: R G B, X Y Z, and the second moments of X Y Z."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Radiance:
    """What Mitsuba finds.

    Attributes
    ----------
    mean : float64 array (h, w, 3)
        Mean radiance of each pixel [W m⁻² sr⁻¹].
    standard_error : float64 array (h, w) or None
        Of the mean's luminance, which is each channel's in a gray scene, from the spread of the samples
        [W m⁻² sr⁻¹].
    """

    mean: FloatArray
    standard_error: FloatArray | None = None


class MitsubaTwin:
    """A matte scene, translated once and rendered under any of its lights, direct light only.

    Height fields other than the sphere become meshes with exact normals at their vertices, finer than the pixels.

    Parameters
    ----------
    scene : Scene
        Matte, with an albedo that is the same everywhere.
    viewpoint : int
        Which of the scene's viewpoints.
    fineness : float
        Nodes of the mesh of a height field for each pixel [1].

    Raises
    ------
    UnsupportedError
        If Mitsuba is not installed, or the scene holds what has no counterpart here.
    """

    def __init__(self, scene: Scene, viewpoint: int = 0, *, fineness: float = 2.0) -> None:
        try:
            import mitsuba as mi
        except ImportError:
            raise _unsupported(
                "Mitsuba is not installed", "Install the package mitsuba, or psstereo with its extra 'test'."
            ) from None
        mi.set_variant("scalar_rgb")
        self._mi: Any = mi
        self._scene = scene
        self._view = scene.viewpoints[viewpoint]
        self._surface = self._shape(scene.surface, fineness)
        self._kept: tuple[tuple[int, bool], Any, Any] | None = None

    def render(self, light: Light, *, samples: int = 16, seed: int = 0, moments: bool = False) -> Radiance:
        """Return the radiance under one light.

        Parameters
        ----------
        light : Light
            A directional light, a lamp that shines all around, a disc, a polygon or a uniform surrounding.
        samples : int
            Samples a pixel; a square number, unless moments are asked for.
        seed : int
            Of the samples.
        moments : bool
            Whether samples are independent, and their spread is returned too.

        Returns
        -------
        Radiance
            The picture.
        """
        image = np.array(self._mi.render(self._load(light, samples, moments), spp=samples, seed=seed), np.float64)
        if not moments:
            return Radiance(mean=image[..., :3])
        luminance, square = image[..., _LUMINANCE], image[..., _LUMINANCE + 3]
        variance = np.maximum(square - luminance**2, 0.0)
        return Radiance(mean=image[..., :3], standard_error=np.sqrt(variance / max(samples - 1, 1)))

    def _load(self, light: Light, samples: int, moments: bool) -> Any:
        """Return Mitsuba's scene with a light; of a sun only the direction changes, and the rest is kept."""
        mi = self._mi
        if isinstance(light, Directional) and self._kept is not None and self._kept[0] == (samples, moments):
            _, scene, values = self._kept
            values["emitter.to_world"] = self._look(np.zeros(3), -light.direction, _across(light.direction))
            values["emitter.irradiance.value"] = mi.Color3f(*_rgb(light.strength)["value"])
            values.update()
            return scene
        direct = {"type": "direct", "hide_emitters": True}
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "moment", "inner": direct} if moments else direct,
                "sensor": self._sensor(samples, independent=moments),
                "surface": self._surface,
                "emitter": self._emitter(light),
            }
        )
        if isinstance(light, Directional):
            self._kept = ((samples, moments), scene, mi.traverse(scene))
        return scene

    @staticmethod
    def use_threads(count: int) -> None:
        """Set on how many threads Mitsuba renders from now on, in all of the process."""
        import drjit

        drjit.set_thread_count(count)

    def _sensor(self, samples: int, *, independent: bool) -> dict[str, Any]:
        mi, pose, camera = self._mi, self._view.pose, self._view.camera
        rows, columns = self._scene.size
        common = {
            "film": {
                "type": "hdrfilm",
                "width": columns,
                "height": rows,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent" if independent else "stratified", "sample_count": samples},
        }
        if isinstance(camera, Orthographic):
            half = 0.5 * camera.pixel_size * columns
            middle = np.array([camera.pixel_size * (columns - 1) / 2, -camera.pixel_size * (rows - 1) / 2, 0.0])
            back = pose.to_scene(middle + np.array([0.0, 0.0, 50.0 * half]))
            place = self._look(back, pose.to_scene(middle), pose.rotation[:, 1]) @ mi.ScalarTransform4f().scale(
                [half, half, 1.0]
            )
            return {"type": "orthographic", "to_world": place, "near_clip": 1e-3, "far_clip": 1e5, **common}
        if not isinstance(camera, Pinhole) or camera.skew != 0 or camera.fx != camera.fy:
            raise _unsupported(f"A {camera.name} camera with square, unsheared pixels is needed", "Use another camera.")
        ahead = pose.position - pose.rotation[:, 2]
        return {
            "type": "perspective",
            "fov": float(2 * np.degrees(np.arctan(columns / (2 * camera.fx)))),
            "fov_axis": "x",
            "principal_point_offset_x": float(((columns - 1) / 2 - camera.cx) / columns),
            "principal_point_offset_y": float(((rows - 1) / 2 - camera.cy) / rows),
            "to_world": self._look(pose.position, ahead, pose.rotation[:, 1]),
            "near_clip": 1e-2,
            "far_clip": 1e5,
            **common,
        }

    def _look(self, origin: FloatArray, target: FloatArray, up: FloatArray) -> Any:
        return self._mi.ScalarTransform4f().look_at(origin.tolist(), target.tolist(), up.tolist())

    def _shape(self, surface: Relief | TriangleMesh, fineness: float) -> Any:
        reflectance = {"type": "rgb", "value": self._albedo()}
        bsdf = {"type": "twosided", "inner": {"type": "diffuse", "reflectance": reflectance}}
        if isinstance(surface, Sphere):
            return {"type": "sphere", "radius": float(surface.radius), "bsdf": bsdf}
        if isinstance(surface, TriangleMesh):
            return self._mesh(surface.vertices, surface.faces, surface.smooth_normals if surface.smooth else None, bsdf)
        return self._mesh(*self._nodes(surface, fineness), bsdf)

    def _nodes(self, relief: Relief, fineness: float) -> tuple[FloatArray, Any, FloatArray]:
        """Sample a height field over the picture, half a pixel beyond the outermost centres."""
        camera, pose = self._view.camera, self._view.pose
        if not isinstance(camera, Orthographic):
            raise _unsupported("A height field is seen through a pinhole", "Give it as a mesh.")
        rows, columns = self._scene.size
        counts = (round(rows * fineness) + 1, round(columns * fineness) + 1)
        c = np.linspace(-0.5, columns - 0.5, counts[1]) * camera.pixel_size + pose.position[0]
        r = -np.linspace(-0.5, rows - 0.5, counts[0]) * camera.pixel_size + pose.position[1]
        x, y = np.meshgrid(c, r)
        found = relief.evaluate(x, y)
        normals = np.stack([-found.slope_x, -found.slope_y, np.ones_like(x)], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        index = np.arange(x.size).reshape(x.shape)
        a, b, d, e = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
        faces = np.concatenate(
            [np.stack([a, d, b], axis=-1).reshape(-1, 3), np.stack([b, d, e], axis=-1).reshape(-1, 3)]
        )
        known = np.isfinite(found.height).ravel()
        points = np.stack([x, y, found.height], axis=-1).reshape(-1, 3)
        points[~known] = 0.0
        return points, faces[known[faces].all(axis=1)], np.nan_to_num(normals.reshape(-1, 3))

    def _mesh(self, vertices: FloatArray, faces: Any, normals: FloatArray | None, bsdf: dict[str, Any]) -> Any:
        mi = self._mi
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(bsdf)
        mesh = mi.Mesh(
            "surface",
            vertex_count=len(vertices),
            face_count=len(faces),
            has_vertex_normals=normals is not None,
            props=properties,
        )
        values = mi.traverse(mesh)
        values["vertex_positions"] = np.ravel(vertices).astype(np.float32)
        values["faces"] = np.ravel(faces).astype(np.uint32)
        if normals is not None:
            values["vertex_normals"] = np.ravel(normals).astype(np.float32)
        values.update()
        return mesh

    def _albedo(self) -> list[float]:
        material = self._scene.material
        if material.model is not Lambert or not isinstance(material.albedo, Constant):
            raise _unsupported("A matte surface of one colour is needed", "Use a lambert material, a constant albedo.")
        values = material.brdf(np.zeros((1, 3))).diffuse_albedo[0]
        if values.size not in (1, 3):
            raise _unsupported(f"The albedo has {values.size} channels", "Use one or three.")
        return [float(v) for v in np.broadcast_to(values, 3)]

    def _emitter(self, light: Light) -> dict[str, Any]:
        mi = self._mi
        if isinstance(light, Directional):
            return {
                "type": "directional",
                "direction": (-light.direction).tolist(),
                "irradiance": _rgb(light.strength),
            }
        if isinstance(light, Led) and light.mu == 0:
            return {"type": "point", "position": light.position.tolist(), "intensity": _rgb(light.flux)}
        if isinstance(light, Ambient):
            return {"type": "constant", "radiance": _rgb(light.radiance)}
        if isinstance(light, Disc):
            place = self._look(light.centre, light.centre + light.axis, _across(light.axis))
            place = place @ mi.ScalarTransform4f().scale([light.radius, light.radius, 1.0])
            return {"type": "disk", "to_world": place, "emitter": {"type": "area", "radiance": _rgb(light.radiance)}}
        raise _unsupported(f"A {light.name} light has no counterpart here", "Use another light.")


def _across(direction: FloatArray) -> FloatArray:
    """Return the axis that is farthest from a direction."""
    return np.asarray(np.eye(3)[np.argmin(np.abs(direction))])


def _rgb(values: FloatArray) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(values, 3)]}


def _unsupported(given: str, remedy: str) -> UnsupportedError:
    return UnsupportedError(
        given=f"{given}.", needed="The comparison with Mitsuba covers simple scenes.", remedy=remedy
    )
