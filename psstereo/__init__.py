"""Photometric stereo: from photographs under several lights to normals, albedo, depth and mesh."""
