"""A glazed vase from eight photographs of one view: one that was left out, a room in real time, and from aside."""

import numpy as np

import gonio as gn

fade = np.linspace(0, 1, 64)[:, None, None]
glaze = gn.Lambert((1 - fade) * [0.55, 0.18, 0.06] + fade * [0.05, 0.2, 0.3])
vase, material = gn.vase(), glaze + gn.Microfacet(gn.GGX(0.3 - 0.12 * fade[..., 0]), gn.Fresnel(1.5))

k = np.arange(9)
x, y, z = gn.from_spherical(np.radians(10 + 6.5 * k), 2.4 * k).T  # right, up, towards the camera
lights = gn.distant_lights(np.stack((x, -z, y), axis=-1), np.full(9, np.pi))
camera = gn.Orthographic(pixel=2.3 / 128, size=(128, 96), pose=gn.look_at((0, -4, 0), (0, 0, 0)))
capture = gn.simulate(vase, material, lights, camera)

places = (capture.sites.positions @ camera.pose[:3, :2]) / 2.3
eight = capture.select([0, 1, 2, 3, 5, 6, 7, 8])
fit = gn.share_reflectance(eight.reflectance(), places, centres=600, scales=gn.Scales(0.3, 0.5))
thing = gn.Relightable(capture.view, capture.textures(fit.value.material))
photograph, image = capture.photographs.read(4).radiance, gn.relight(thing, lights[4])
off = np.sqrt(np.mean((image - photograph) ** 2) / np.mean(photograph**2))
print(f"{fit.reason}; the photograph that was left out is predicted to {100 * off:.1f} %")

quick = gn.precompute(thing, error=0.05, side=6)
room = gn.studio(64)
aside = gn.Pinhole.look_at(eye=(1.9, -3.2, 0.9), target=(0, 0, 0), field_of_view=36, size=(128, 96))
other = gn.render(thing.surface, thing.material, room, aside, supersample=2, background=False)
row = np.concatenate((photograph, image, quick.relight(room), other), axis=1)
gn.write_image("11_reflectance_sharing.png", gn.tone_map(row, exposure=1.6), clip=True)
