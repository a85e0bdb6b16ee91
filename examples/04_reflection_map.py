"""A room blurred by Phong's lobe, as a product in harmonics: one map for every point and view."""

import gonio as gn
from gonio.sphere import zonal

room = gn.studio(128)
sharp, soft = (gn.reflection_map(room, zonal.phong(127, s), rows=128, error=0.01) for s in (200, 20))

wo, n = gn.normalise([1.0, 0.0, 1.0]), [0.0, 0.0, 1.0]
print("along the mirror direction:", sharp.radiance(gn.reflect(wo, n)), soft.radiance(gn.reflect(wo, n)))

gn.write_image("04_sharp.png", gn.tone_map(sharp.image))
gn.write_image("04_soft.png", gn.tone_map(soft.image))
