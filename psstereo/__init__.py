"""Photometric stereo: from photographs under several lights to normals, albedo, depth and mesh.

The names are listed in ``__init__.pyi``; each is imported when it is first used, so that the package itself
is there at once.

Examples
--------
>>> import numpy as np
>>> import psstereo
>>> rig = psstereo.Rig.distant([[0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.6, 0.8], [0, -0.6, 0.8]])
>>> images = psstereo.lambertian_images(np.array([[[0.0, 0.0, 1.0]]]), np.array([[0.25]]), rig)
>>> result = psstereo.estimate_normals(psstereo.Capture(stack=psstereo.MemoryStack(images), rig=rig))
>>> result.normals[0, 0, 2].round(6).item(), result.albedo[0, 0].round(6).item()
(1.0, 0.25)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
