"""A matte ball under a directional light: the smallest picture."""

import gonio as gn

camera = gn.Pinhole.look_at(eye=(0, -4, 1), target=(0, 0, 0), field_of_view=32, size=(256, 256))
sun = gn.Directional(direction=gn.normalise([1.0, -1.0, 1.0]), irradiance=3.0)

image = gn.render(gn.Sphere(), gn.Lambert(0.7), sun, camera)

gn.write_image("01_lambert.exr", image)
gn.write_image("01_lambert.png", gn.tone_map(image))
