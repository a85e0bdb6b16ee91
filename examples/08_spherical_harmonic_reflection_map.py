"""A glossy vase from maps made beforehand, beside the sum over the room's light: the same picture in a glance."""

import time

import numpy as np

import gonio as gn

room, vase = gn.studio(128), gn.vase()
satin = gn.Lambert([0.1, 0.2, 0.4]) + 0.7 * gn.Microfacet(gn.GGX(0.4), gn.Schlick([0.6, 0.6, 0.6]))
maps = gn.prefilter(room, satin, error=0.03)  # RH 5.4; the degrees follow from the error
for lobe in maps.lobes:
    print(f"about the {lobe.about.value} direction, F = {lobe.degree}, P = {lobe.exit_degree}")
print(f"pictures of a ball miss {maps.error:.1%}, rms")

camera = gn.Pinhole.look_at(eye=(3.9, -4.6, 2.1), target=(0, 0, 0), field_of_view=22, size=(240, 180))
gn.render_prefiltered(vase, maps, camera, background=room)  # the first call compiles
began = time.perf_counter()
quick = gn.render_prefiltered(vase, maps, camera, background=room)
between = time.perf_counter()
slow = gn.render(vase, satin, room, camera)
print(f"{1000 * (between - began):.0f} ms, {1000 * (time.perf_counter() - between):.0f} ms")

picture = np.concatenate((quick, slow, 10 * np.abs(quick - slow)), axis=1)
gn.write_image("08_shrm.png", gn.tone_map(picture, exposure=1.0))

turned = maps.rotated(gn.euler(0.0, 1.0, 0.0))  # the room turned about the vase: coefficients, no new maps
gn.write_shrm("08_room.gonio", turned)
