"""One vase in three materials under a room: models are values, and they add."""

import numpy as np

import gonio as gn

gold = gn.Conductor(eta=[0.18, 0.54, 1.33], k=[3.43, 2.23, 1.87])
materials = [
    gn.Lambert([0.45, 0.06, 0.05]) + gn.Microfacet(gn.GGX(0.12), gn.Fresnel(1.5)),  # lacquer
    gn.Microfacet(gn.GGX(0.12, 0.4), gold),  # brushed along the circle
    gn.Lambert([0.08, 0.16, 0.36]) + gn.Microfacet(gn.Beckmann(0.35), gn.Fresnel(1.5)),  # satin
]
camera = gn.Pinhole.look_at(eye=(3.9, -4.6, 2.1), target=(0, 0, 0), field_of_view=22, size=(480, 360))

room, shape = gn.studio(), gn.vase()
images = [gn.render(shape, material, room, camera, supersample=2) for material in materials]
picture = np.concatenate(images, axis=1)

gn.write_image("02_three_vases.exr", picture)
gn.write_image("02_three_vases.png", gn.tone_map(picture, exposure=1.0))
