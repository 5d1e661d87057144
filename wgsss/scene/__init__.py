"""Scenes: meshes, materials, lights, cameras, and the files they are read from. No GPU code."""

from __future__ import annotations

from wgsss.scene.bodies import LoadedFile, LoadedMesh, load_file, load_mesh
from wgsss.scene.camera import Camera, OrthographicCamera, PerspectiveCamera
from wgsss.scene.light import DirectionalLight, EnvironmentLight, Light, PointLight, RectLight, SphereLight
from wgsss.scene.loading import load_material, load_scene
from wgsss.scene.material import MATERIALS, Maps, Material, material
from wgsss.scene.mesh import Mesh
from wgsss.scene.scene import Object, Scene

__all__ = [
    "MATERIALS",
    "Camera",
    "DirectionalLight",
    "EnvironmentLight",
    "Light",
    "LoadedFile",
    "LoadedMesh",
    "Maps",
    "Material",
    "Mesh",
    "Object",
    "OrthographicCamera",
    "PerspectiveCamera",
    "PointLight",
    "RectLight",
    "Scene",
    "SphereLight",
    "load_file",
    "load_material",
    "load_mesh",
    "load_scene",
    "material",
]
