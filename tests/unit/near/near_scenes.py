"""Scenes under near lamps in closed form: a sphere seen through a pinhole or in parallel, and its images."""

import numpy as np

from psstereo.camera import Orthographic, Pinhole
from psstereo.capture import Capture
from psstereo.lights import Led, Rig
from psstereo.stack import MemoryStack


def ring(count=12, *, radius=300.0, height=0.0, mu=1.0, aim=(0.0, 0.0, -600.0), flux=1.0):
    """Return lamps on two circles around the camera, aimed at a point, fluxes between half and one and a half."""
    lamps = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        r = radius * (1.0 if i % 2 else 0.5)
        position = np.array([r * np.cos(angle), r * np.sin(angle), height + 20.0 * np.cos(3 * angle)])
        strength = np.asarray(flux) * (1.0 + 0.5 * np.sin(5 * angle)) * 1e5
        lamps.append(Led(position=position, axis=np.subtract(aim, position), mu=mu, flux=strength))
    return tuple(lamps)


def dome(count=24, *, centre=(10.0, -5.0, -600.0), distance=400.0, tilt=60.0):
    """Return lamps on a spiral over a cap around a point, as far as `tilt` degrees from z, aimed at it."""
    lamps = []
    for k in range(count):
        z = 1 - (1 - np.cos(np.radians(tilt))) * (k + 0.5) / count
        angle, across = k * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - z * z)
        direction = np.array([across * np.cos(angle), across * np.sin(angle), z])
        lamps.append(Led(position=centre + distance * direction, axis=-direction, mu=1.0, flux=1e5))
    return tuple(lamps)


def pinhole_sphere(size=48, *, radius=90.0, distance=600.0, focal=3.0):
    """Return camera, distances (h, w), normals and mask of a sphere in front of a pinhole, border left out."""
    camera = Pinhole(fx=focal * size, fy=focal * size, cx=(size - 1) / 2 + 1.3, cy=(size - 1) / 2 - 0.7)
    rays = camera.rays((size, size))
    centre = np.array([10.0, -5.0, -distance])
    a, b = (rays * rays).sum(axis=-1), rays @ centre
    inside = b * b - a * (centre @ centre - radius**2)
    mask = inside > 0.1 * radius**2
    depth = np.where(mask, (b - np.sqrt(np.where(mask, inside, 0.0))) / a, np.nan)
    normals = (rays * depth[..., None] - centre) / radius
    return camera, depth, normals, mask


def parallel_sphere(size=48, *, radius=90.0, height=-600.0):
    """Return the same for parallel projection, heights instead of distances."""
    camera = Orthographic(pixel_size=2.2 * radius / size, length_unit="mm")
    points = camera.points(np.zeros((size, size)))
    middle = points[size // 2, size // 2]
    across = points[..., :2] - middle[:2]
    up = radius**2 - (across**2).sum(axis=-1)
    mask = up > 0.2 * radius**2
    rise = np.sqrt(np.where(mask, up, 0.0))
    depth = np.where(mask, height - radius + rise, np.nan)
    normals = np.where(mask[..., None], np.concatenate([across, rise[..., None]], axis=-1) / radius, np.nan)
    return camera, depth, normals, mask


def shoot(camera, depth, normals, mask, lamps, *, albedo=0.5, noise=0.0, seed=0):
    """Return the capture of a matte surface under lamps, float64, without cast shadows."""
    points = np.where(mask[..., None], camera.points(np.where(mask, depth, 1.0)), 0.0)
    facing = np.where(mask[..., None], normals, [0.0, 0.0, 1.0])
    images = np.stack([lamp.irradiance(points, facing) for lamp in lamps]) * albedo * mask[..., None]
    images = images / images.max()
    if noise:
        rng = np.random.default_rng(seed)
        images = images + noise * images[images > 0].mean() * rng.normal(size=images.shape)
    return Capture(stack=MemoryStack(images), rig=Rig(lamps), camera=camera, mask=mask)


def shoot_glossy(camera, depth, normals, mask, lamps, *, brdf, noise=0.0, seed=0):
    """Return the capture of a surface of any reflectance under lamps, float64, without cast shadows."""
    points = camera.points(np.where(mask, depth, 1.0))[mask]
    facing = normals[mask]
    rays = camera.rays(mask.shape)[mask]
    to_eye = -rays / np.linalg.norm(rays, axis=1, keepdims=True)
    images = np.zeros((len(lamps), *mask.shape, 1))
    for image, lamp in zip(images, lamps, strict=True):
        to_light = lamp.position - points
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        image[mask] = lamp.irradiance(points, facing) * np.pi * brdf.evaluate(facing, to_light, to_eye)
    images /= images.max()
    if noise:
        images += noise * images[images > 0].mean() * np.random.default_rng(seed).normal(size=images.shape)
    return Capture(stack=MemoryStack(images), rig=Rig(tuple(lamps)), camera=camera, mask=mask)
