"""A relief photographed under twenty lights, and its normals and heights from the shading."""

import numpy as np

import gonio as gn

y, x = np.mgrid[-1:1:120j, -1:1:120j]
relief = gn.HeightField(8 * np.exp(-4 * ((x - 0.3) ** 2 + y**2)) + 2 * np.sin(6 * x) * np.cos(5 * y))
plastic = gn.Lambert([0.5, 0.35, 0.2]) + gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5))

k = np.arange(20)
lights = gn.distant_lights(gn.from_spherical(np.radians(15 + 2.5 * k), 2.4 * k), np.full(20, np.pi))
sensor = gn.Sensor(exposure=1.2, gain=1e-4, read=1e-3, bits=8)
capture = gn.simulate(relief, plastic, lights, relief.camera(), sensor=sensor, shadows=True)

found = gn.photometric_stereo(capture)
off = np.degrees(np.arccos(np.sum(found.normals * capture.normals, axis=-1).clip(-1, 1)))
print(f"normals: {np.median(off):.2f} degrees off, {np.degrees(np.median(found.error)):.2f} foreseen")

surface = gn.integrate_normals(found.normals, weights=1 / found.error**2)
print(f"heights: {np.std(surface.heights - relief.heights):.2f} pixels off, of {np.ptp(relief.heights):.1f}")
gn.write_image("10_normals.png", 0.5 * found.normals + 0.5, "linear", clip=True)
