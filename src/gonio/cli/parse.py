"""What a person types, turned into values: reflectance, lights, vectors, sizes. Nothing typed is ever run.

--brdf lambert:albedo=.5/.3/.1  --brdf ggx:alpha=.2,eta=1.5         terms that are added
--brdf gold.bsdf                                                    a measured file
--brdf sgd_params.json:teflon                                       a material of a file of fits
--brdf lambert:albedo=@wood.png                                     a texture over uv, linear
--sun 1,0,1   --sun 1,0,1:3/2.8/2.5                                 direction[:irradiance]
"""

from __future__ import annotations

import dataclasses
import difflib
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError

if TYPE_CHECKING:
    from ..brdf.model import BRDF
    from ..lights.points import Directional

ANALYTIC = {
    "lambert": "Lambert",
    "oren-nayar": "OrenNayar",
    "phong": "Phong",
    "modified-phong": "ModifiedPhong",
    "blinn-phong": "BlinnPhong",
    "lafortune": "Lafortune",
    "ward": "Ward",
    "torrance-sparrow": "TorranceSparrow",
    "kajiya-kay": "KajiyaKay",
}
FACETS = {"ggx": "GGX", "beckmann": "Beckmann"}


def numbers(text: str, separator: str = ",") -> tuple[float, ...]:
    """`1,0,.5` -> (1.0, 0.0, 0.5)."""
    try:
        return tuple(float(part) for part in text.split(separator))
    except ValueError:
        raise ParameterError(f"'{text}' is not numbers separated by '{separator}'.") from None


def vector(text: str) -> tuple[float, float, float]:
    """`1,0,.5` -> three numbers."""
    values = numbers(text)
    if len(values) != 3:
        raise ParameterError(f"'{text}' has {len(values)} numbers; a vector is x,y,z.")
    return values[0], values[1], values[2]


def size(text: str) -> tuple[int, int]:
    """`640x480` or `512` -> (columns, rows)."""
    width, _, height = text.lower().partition("x")
    try:
        columns, rows = int(width), int(height or width)
    except ValueError:
        raise ParameterError(f"'{text}' is not a size; write 640x480, or 512 for a square.") from None
    if min(columns, rows) < 1:
        raise ParameterError(f"'{text}' has no pixels.")
    return columns, rows


def directional(text: str) -> Directional:
    """`x,y,z` or `x,y,z:irradiance` (a number, or r/g/b) -> a directional light."""
    from ..directions import normalise
    from ..lights.points import Directional

    towards, _, power = text.partition(":")
    return Directional(normalise(list(vector(towards)), "--sun"), _value(power) if power else 1.0)


def reflectance(terms: list[str]) -> BRDF:
    """The sum of `name:key=value,...` terms, or of measured files."""
    return reduce(lambda a, b: a + b, (_term(term) for term in terms))


def _term(text: str) -> BRDF:
    import gonio as gn

    name, _, rest = text.partition(":")
    if Path(name).suffix.lower() == ".json":
        return _fitted(name, rest)
    if name not in ANALYTIC and name not in FACETS:
        if Path(text).suffix and (Path(text).exists() or "/" in text):
            return gn.read_brdf(text)
        known = [*ANALYTIC, *FACETS]
        near = difflib.get_close_matches(name, known, n=1)
        hint = f" Did you mean {near[0]}?" if near else ""
        raise ParameterError(f"'{name}' is neither a file nor a model ({', '.join(known)}).{hint}")
    pairs = [_pair(part, text) for part in rest.split(",")] if rest else []
    given = dict(pairs)
    if len(given) < len(pairs):
        raise ParameterError(f"'{text}' says one thing twice.")
    weight = given.pop("weight", None)
    if name in FACETS:
        brdf: BRDF = _microfacet(FACETS[name], given, text)
    else:
        brdf = _made(getattr(gn, ANALYTIC[name]), given, text)
    return brdf if weight is None else weight * brdf


def _fitted(path: str, material: str) -> BRDF:
    import gonio as gn

    fits = gn.read_merl_fits(path)
    if material in fits:
        return fits[material]
    near = difflib.get_close_matches(material, fits, n=1) or [next(iter(fits))]
    raise ParameterError(f"{path} has no material '{material}'; write {path}:{near[0]}, for instance.")


def _microfacet(facets: str, given: dict[str, Any], text: str) -> BRDF:
    """`alpha`, and `alpha_y` where they differ; `eta` (dielectric), `eta` and `k` (conductor) or `f0` (Schlick)."""
    import gonio as gn

    optics: dict[str, Any] = {key: given.pop(key) for key in ("f0", "eta", "k") if key in given}
    fresnel = gn.Schlick if "f0" in optics else gn.Conductor if "k" in optics else gn.Fresnel
    return gn.Microfacet(_made(getattr(gn, facets), given, text), _made(fresnel, optics, text))


def _made(model: Any, given: dict[str, Any], text: str) -> Any:
    import gonio as gn

    fields = [field.name for field in dataclasses.fields(model) if field.init]
    for key in given:
        if key not in fields:
            raise ParameterError(f"'{text}': {model.__name__} has no '{key}'; it has {', '.join(fields)}.")
        colour = key in model.bounds and model.bounds[key].colour
        if isinstance(given[key], list) and not colour:
            raise ParameterError(f"'{text}': {key} is one number; only colours are written r/g/b.")
        if isinstance(given[key], Path):
            image = gn.read_image(given[key])
            given[key] = image if colour else image[..., 0]
    missing = [
        field.name
        for field in dataclasses.fields(model)
        if field.init
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
        and field.name not in given
    ]
    if missing:
        raise ParameterError(f"'{text}': {model.__name__} also needs {', '.join(missing)}.")
    return model(**given)


def _pair(part: str, text: str) -> tuple[str, Any]:
    key, equals, value = part.partition("=")
    if not equals:
        raise ParameterError(f"'{text}': '{part}' is not key=value.")
    return key.strip().replace("-", "_"), Path(value[1:]) if value.startswith("@") else _value(value)


def _value(text: str) -> Any:
    values = numbers(text, "/")
    return values[0] if len(values) == 1 else list(values)
