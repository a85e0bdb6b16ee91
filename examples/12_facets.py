"""Damask from one view under sixty lights: a distribution of facets at every texel, and a cloth that is made of it."""

import dataclasses

import numpy as np

import gonio as gn

line = (np.arange(40) + 0.5) / 20 - 1
x, y = (
    part.reshape(-1, 1) + np.array(corners) / 40
    for part, corners in zip(np.meshgrid(line, line), ([-1, 1, 1, -1], [-1, -1, 1, 1]), strict=True)
)
figure = np.cos(2 * np.pi * x[:, :1]) + np.cos(2 * np.pi * y[:, :1]) > 0.2 * np.cos(6 * np.pi * (x - y)[:, :1])
uv = 0.5 + 0.4 * np.where(figure[..., None], np.stack((y, -x), axis=-1), np.stack((x, y), axis=-1))
faces = (4 * np.arange(1600)[:, None, None] + [[0, 1, 2], [0, 2, 3]]).reshape(-1, 3)
sample = gn.Mesh(np.stack((x, y, 0 * x), axis=-1).reshape(-1, 3), faces, uv=uv.reshape(-1, 2))
damask = gn.Lambert([0.25, 0.03, 0.05]) + gn.Microfacet(gn.Beckmann(0.2, 0.5), gn.Fresnel(1.8))

n = np.arange(60)
lights = gn.distant_lights(gn.from_spherical(np.arccos(1 - n / 75), 2.4 * n), np.full(60, np.pi))
camera = gn.Orthographic(pixel=1.98 / 36, size=(30, 36), pose=gn.look_at((0, -2, 3), (0, 0, 0)))
seen = gn.simulate(sample, damask, lights, camera, gn.Sensor(exposure=0.5, gain=2e-5, read=2e-4))
capture = dataclasses.replace(seen, shape=None)  # that it is flat is all that is known

kept = [k for k in range(60) if k != 31]
fit = gn.synthesise_ndfs(capture.select(kept).reflectance(), grid=gn.PolarGrid(16, 48))
thing = gn.Relightable(capture.view, capture.textures(fit.value.material))
photograph, image = capture.photographs.read(31).radiance, gn.relight(thing, lights[31])
off = np.sqrt(np.mean((image - photograph) ** 2) / np.mean(photograph**2))
print(f"{fit.reason}; the photograph that was left out is predicted to {100 * off:.1f} %")

eye = gn.Pinhole.look_at(eye=(1.6, -2.6, 1.5), target=(0, 0, -0.1), field_of_view=28, size=(320, 320))
sun = gn.Directional(gn.normalise([0.2, -1, 1.2]), 6.0)
worn = gn.render(gn.Repeated(gn.cloth(), 5), thing.material, sun, eye, supersample=2)
gn.write_image("12_facets.png", gn.tone_map(worn, exposure=1), clip=True)
