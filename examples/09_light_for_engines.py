"""The nine coefficients of a room as renderers store them, and as moments that can be turned by hand."""

import dataclasses

import numpy as np

import gonio as gn

room = gn.studio(64)
light = np.asarray(room.harmonics(2))

gn.write_sh("09_filament.txt", light, gn.Engine.FILAMENT)  # what cmgen would write
gn.write_sh("09_unity.json", light, gn.Engine.UNITY)
print("read back:", np.abs(gn.read_sh("09_unity.json") - light).max())

moments = gn.Moments.of(light)
print("one-sidedness:", np.round(moments.one_sidedness, 2))
softer = dataclasses.replace(moments, vector=moments.vector / 2)  # as if more light came from all around

camera = gn.Orthographic(pixel=0.02, size=(128, 128), pose=gn.look_at(eye=(2, -3, 1), target=(0, 0, 0)))
images = gn.basis_images(gn.Sphere(), camera)  # nine of them: RH figure 4.3
pictures = [np.nan_to_num(gn.relit(images, one)).clip(0) for one in (light, softer.coefficients())]
gn.write_image("09_softer.png", gn.tone_map(np.concatenate(pictures, axis=1), exposure=1.0))
