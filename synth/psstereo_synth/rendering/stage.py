"""A scene from one viewpoint: all that does not depend on the light, and an image under each."""

from dataclasses import dataclass

import numpy as np

from psstereo.brdf import Brdf
from psstereo.capture import Capture, Truth
from psstereo.forward import Geometry, Shading, Shadows, shade
from psstereo.lights import Light, Rig
from psstereo.stack import MemoryStack
from psstereo.types import Array, FloatArray, Map, Progress
from psstereo_synth.faults import apply_order, apply_radiance, apply_values
from psstereo_synth.rendering.bounce import Bounce
from psstereo_synth.scenes import Scene
from psstereo_synth.sensor import Sensor
from psstereo_synth.view import View

__all__ = ["Stage"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A scene seen from one viewpoint.

    Attributes
    ----------
    scene : Scene
        The scene.
    number : int
        Of the viewpoint, from 0.
    view : View
        Where the surface is.
    brdf : Brdf
        Its reflectance there.
    shadows : Shadows or None
        What stands in the light.
    bounce : Bounce or None
        Light that is reflected once more.
    always : float64 array (p, c) or None
        Radiance that is there in every image [W m⁻² sr⁻¹].
    """

    scene: Scene
    number: int
    view: View
    brdf: Brdf
    shadows: Shadows | None
    bounce: Bounce | None
    always: FloatArray | None

    @classmethod
    def prepare(cls, scene: Scene, number: int, view: View, shadows: Shadows | None, bounce: Bounce | None) -> "Stage":
        """Work out what does not depend on the light."""
        brdf = scene.material.brdf(view.geometry.points)
        stage = cls(scene=scene, number=number, view=view, brdf=brdf, shadows=shadows, bounce=bounce, always=None)
        if scene.ambient is None:
            return stage
        always = stage.shade(scene.ambient).radiance
        return cls(scene=scene, number=number, view=view, brdf=brdf, shadows=shadows, bounce=bounce, always=always)

    @property
    def geometry(self) -> Geometry:
        """What the camera sees."""
        return self.view.geometry

    def shade(self, light: Light) -> Shading:
        """Shade the surface under a light, with light that it reflects onto itself."""
        scene = self.scene
        direct = shade(
            self.geometry, self.brdf, light, shadows=self.shadows, beams=scene.beams, extinction=scene.extinction
        )
        more = self.bounced(light)
        return direct if more is None else Shading(radiance=direct.radiance + more, visibility=direct.visibility)

    def bounced(self, light: Light) -> FloatArray | None:
        """Return the radiance of light that is reflected once more, (p, c), None without any [W m⁻² sr⁻¹]."""
        if self.bounce is None:
            return None
        return np.asarray(self.brdf.diffuse_albedo / np.pi * self.bounce.irradiance(light))

    def shoot(self, sensor: Sensor, rig: Rig, over: Map, progress: Progress) -> tuple[Capture, Truth]:
        """Take all images.

        Parameters
        ----------
        sensor : Sensor
            With its exposure.
        rig : Rig
            The lights as they are written down, in the scene's frame.
        over : map-like
            Executes the images.
        progress : callable
            Told how many are done.

        Returns
        -------
        capture : Capture
            As a camera would deliver it.
        truth : Truth
            What is known of it.
        """
        scene, count = self.scene, len(self.scene.lights)
        order = apply_order(scene.faults, count, scene.seed)
        images = np.zeros((count, *scene.size, self._channels()), sensor.dtype)
        visibility = np.zeros((count, *scene.size), np.float32)

        def take(i: int) -> None:
            shading = self.shade(scene.lights[order[i]])
            radiance = shading.radiance if self.always is None else shading.radiance + self.always
            images[i] = self._photograph(sensor, radiance, order[i])
            visibility[i] = self.geometry.scatter(shading.visibility)

        stage = "rendering" if len(scene.viewpoints) == 1 else f"rendering view {self.number + 1}"
        for done, _ in enumerate(over(take, range(count)), 1):
            progress(stage, done, count)
        stack = MemoryStack(images, white=None if sensor.bits is None else sensor.white_value)
        return self._capture(stack, sensor, rig), self._truth(visibility)

    def _photograph(self, sensor: Sensor, radiance: FloatArray, index: int) -> Array:
        """Return the numbers of one image; `index` is the exposure's, the one after the last is the dark frame's."""
        scene = self.scene
        # Photographs from another viewpoint are other photographs, with noise and mishaps of their own.
        shot = self.number * (len(scene.lights) + 1) + index
        image = self.geometry.scatter(np.broadcast_to(radiance, (len(radiance), self._channels())))
        image = apply_radiance(scene.faults, image, shot, scene.seed)
        return apply_values(scene.faults, sensor.expose(image, shot), shot, sensor.white_value, scene.seed)

    def _channels(self) -> int:
        ambient = [] if self.scene.ambient is None else [self.scene.ambient.channels]
        return max(self.brdf.channels, *(light.channels for light in self.scene.lights), *ambient)

    def _capture(self, stack: MemoryStack, sensor: Sensor, rig: Rig) -> Capture:
        scene, pose = self.scene, self.view.pose
        dark = None
        if scene.dark_frame:
            left = np.zeros((len(self.geometry.points), 1)) if self.always is None else self.always
            taken = self._photograph(sensor, left, len(scene.lights))
            dark = sensor.response.linearise(taken, sensor.white_value)
        turn = pose.rotation.T
        lights = tuple(light.moved(turn, -turn @ pose.position) for light in rig.lights)
        return Capture(
            stack=stack,
            rig=Rig(lights, rig.strength_unit, rig.source),
            camera=self.view.camera,
            mask=self.geometry.mask,
            response=sensor.response,
            dark=dark,
            radiance_at_white=sensor.white,
            name=f"{scene.name} {self.number + 1}" if len(scene.viewpoints) > 1 else scene.name,
        )

    def _truth(self, visibility: FloatArray) -> Truth:
        albedo = self.brdf.diffuse_albedo
        spread = np.broadcast_to(albedo, (len(self.geometry.points), albedo.shape[-1]))
        image = self.geometry.scatter(np.ascontiguousarray(spread), np.nan)
        known = bool(np.isfinite(albedo).any())  # a measured reflectance has no diffuse part that is told apart
        return Truth(
            normals=self.view.normals(),
            depth=self.view.depth,
            albedo=None if not known else image[..., 0] if image.shape[2] == 1 else image,
            visibility=visibility,
            source=self.scene.name,
        )
