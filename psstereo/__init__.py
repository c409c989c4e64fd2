"""Photometric stereo and shape from shading: from photographs under several lights to normals, albedo, depth and mesh."""
