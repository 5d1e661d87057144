"""Readers of image files: textures of any bit depth (`read_map`, `read_levels`), radiance and skies (.hdr, .exr)."""

from __future__ import annotations

from wgsss.scene.images.files import MAX_SIDE
from wgsss.scene.images.maps import read_levels, read_map
from wgsss.scene.images.pixels import read_pixels
from wgsss.scene.images.radiance import read_radiance, read_sky
from wgsss.userfiles import require_file

__all__ = ["MAX_SIDE", "read_levels", "read_map", "read_pixels", "read_radiance", "read_sky", "require_file"]
