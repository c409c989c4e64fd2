"""Named scenes, from easy to cruel: one scene file each, in this folder."""

from psstereo_synth.gallery.gallery import GALLERY, gallery_scene, summaries

__all__ = ["GALLERY", "gallery_scene", "summaries"]
