"""How much of the light comes back: directional albedo of models, from above to grazing."""

import numpy as np

import gonio as gn

models = {
    "Lambert .5": gn.Lambert(0.5),
    "Oren-Nayar .5, .4 rad": gn.OrenNayar(0.5, 0.4),
    "GGX .3, glass": gn.Microfacet(gn.GGX(0.3), gn.Fresnel(1.5)),
    "GGX .3, perfect mirror facets": gn.Microfacet(gn.GGX(0.3), gn.Schlick(1.0)),
    "Ward .5, .2": gn.Ward(0.5, 0.2),
}
theta = np.radians([0, 30, 60, 80])
print(f"{'theta_o':30}", *(f"{np.degrees(t):7.0f}" for t in theta))
for name, model in models.items():
    albedo = gn.albedo(model, gn.from_spherical(theta, 0.0))
    print(f"{name:30}", *(f"{a:7.4f}" for a in albedo[:, 0]))
