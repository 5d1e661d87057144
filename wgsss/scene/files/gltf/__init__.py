"""Reader of glTF 2.0 files (.gltf and .glb): https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html"""

from __future__ import annotations

from pathlib import Path

from wgsss.scene.files.contents import Contents
from wgsss.scene.files.gltf.animations import read_animations
from wgsss.scene.files.gltf.container import damaged
from wgsss.scene.files.gltf.document import Document
from wgsss.scene.files.gltf.extensions import check_required, note_unknown
from wgsss.scene.files.gltf.nodes import read_nodes
from wgsss.scene.files.gltf.notes import Notes
from wgsss.scene.files.gltf.parts import read_parts
from wgsss.scene.files.gltf.rig import read_rig
from wgsss.scene.files.gltf.views import read_cameras, read_lights

MM_PER_UNIT = 1000.0
"""glTF files are in metres"""


def read_gltf(path: Path) -> Contents:
    """Read the scene of a glTF file, with notes on data that are left out. Images are not decoded.

    Raises InputError, in one line that names the file and the location in it, if the file is missing, is damaged, has
    no triangles, is not glTF 2, or requires an extension that cannot be read.
    """
    with damaged(path):
        document, notes = Document(path), Notes()
        check_required(document)
        scene = read_nodes(document)
        placed = read_parts(document, scene, notes)
        rig = read_rig(document, scene, placed, notes)
        animations = {} if rig is None else read_animations(path, document, scene.nodes.rest, notes)
        lights, cameras = read_lights(document, scene, notes), read_cameras(document, scene, notes)
        note_unknown(document, notes)
        parts = tuple(primitive.part for primitive in placed)
        return Contents(
            parts,
            mm_per_unit=MM_PER_UNIT,
            states_unit=True,
            splits=len(parts) > 1 or any(part.normals is not None or part.uvs for part in parts),
            lights=lights,
            cameras=cameras,
            rig=rig,
            animations=animations,
            notes=notes.lines(),
        )
