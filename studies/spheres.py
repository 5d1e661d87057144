"""Measure how far the profile of a half space is from light transport in a ball; needs Mitsuba 3 and some minutes.

The balls are index-matched and have a radius of 10 or 50 mean free paths of the green channel. They are lit by a
uniform sky or by a beam from the side. The table gives the relative RMS error of M against `volume`, without the noise
of `volume`, with the profile by photons and with the dipole.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wgsss.bake.photons import trace
from wgsss.gpu import default_gpu
from wgsss.reference.integral import integral
from wgsss.reference.volume import Volume
from wgsss.scene import DirectionalLight, EnvironmentLight, Object, OrthographicCamera, Scene, material, shapes
from wgsss.stage import Stage

SIZE = (24, 24)
LIGHTS = {"sky": EnvironmentLight((1, 1, 1)), "beam": DirectionalLight((-1, 0, 0), (1, 1, 1))}

print("material    mean free paths  light  photons of a beam  of a sky  dipole  noise")
for name in ("marble", "wholemilk", "skin1"):
    medium = replace(material(name), eta=1.0)
    photons = [trace(medium.stack, sky=sky, label=name) for sky in (False, True)]
    for paths in (10, 50):
        radius = paths / (medium.sigma_a[1] + medium.sigma_s_prime[1])
        camera = OrthographicCamera((0, 0, 9 * radius), (0, 0, 0), height=2.05 * radius)
        for kind, light in LIGHTS.items():
            stage = Stage(default_gpu(), Scene(name, (Object(shapes.sphere(radius, 2000), medium),), (light,), camera))
            truth = Volume(samples=512).estimate(stage, SIZE)
            seen = truth.M.max(axis=2) > 0
            mean, noise = (np.square(part[seen]).mean() for part in (truth.M, truth.error))
            off = []
            for profile in (*photons, medium.profile):
                M = integral(stage, SIZE, profiles={0: profile}).M
                off.append(math.sqrt(max(np.square((M - truth.M)[seen]).mean() - noise, 0.0) / mean))
            shares = "   ".join(f"{100 * share:6.1f} %" for share in (*off, math.sqrt(noise / mean)))
            print(f"{name:10}  {paths:15}  {kind:5}  {shares}")
