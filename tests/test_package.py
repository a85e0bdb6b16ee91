"""Facts about the package itself: what it imports, names, declares, locks and ships."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import gonio as gn

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "src" / "gonio").rglob("*.py"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CORE = [Requirement(r) for r in PROJECT["dependencies"]]
EXTRAS = [Requirement(r) for group in PROJECT["optional-dependencies"].values() for r in group]

PUBLIC = [
    (alias.name, statement.module)
    for statement in ast.parse((ROOT / "src" / "gonio" / "__init__.pyi").read_text(encoding="utf-8")).body
    if isinstance(statement, ast.ImportFrom)
    for alias in statement.names
]


def python(code: str) -> str:
    """What a fresh interpreter prints when it runs `code`."""
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout


def test_importing_gonio_imports_no_mathematics():
    heavy = "{'numpy', 'scipy', 'numba', 'cv2', 'OpenEXR', 'trimesh', 'torch', 'matplotlib', 'array_api_compat'}"
    assert python(f"import sys, gonio; print({heavy} & set(sys.modules))").strip() == "set()"


def test_the_command_line_answers_without_mathematics():
    code = "import sys, gonio.cli; print({'numpy', 'scipy', 'numba', 'cv2', 'matplotlib'} & set(sys.modules))"
    assert python(code).strip() == "set()"


@pytest.mark.parametrize(("name", "module"), PUBLIC, ids=[name for name, _ in PUBLIC])
def test_a_public_name_resolves_and_is_documented(name, module):
    value = getattr(gn, name)
    if callable(value):
        assert value.__doc__, f"{name} of {module} has no docstring"
        # A dataclass without a docstring is given its signature for one.
        assert not value.__doc__.startswith(f"{name}("), f"{name} of {module} has no docstring"


def test_public_names_stand_once():
    names = [name for name, _ in PUBLIC]
    assert len(set(names)) == len(names)


def test_the_layers_hold():
    pytest.importorskip("importlinter")
    lint = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"]
    outcome = subprocess.run(lint, capture_output=True, text=True, cwd=ROOT, check=False)
    assert outcome.returncode == 0, outcome.stdout


def third_parties(source: Path) -> set[str]:
    """The top-level packages that `source` imports, anywhere in it, other than gonio and the standard library."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - {"gonio"}


def test_every_import_is_a_declared_dependency_and_the_reverse():
    # The import name of a package that is not installed here (an extra, or no wheel for this machine) is its own name.
    provided = {package: {canonicalize_name(d) for d in names} for package, names in packages_distributions().items()}
    imported = set().union(*map(third_parties, SOURCES))
    used = {name for package in imported for name in provided.get(package, {canonicalize_name(package)})}
    assert used == {canonicalize_name(r.name) for r in CORE + EXTRAS}


@pytest.mark.parametrize("lock", ["test", "dev"])
def test_the_lock_holds_what_is_declared_and_names_no_host(lock):
    text = (ROOT / "requirements" / f"{lock}.lock").read_text(encoding="utf-8")
    locked = re.findall(r"^([a-z0-9.-]+)==([^ ;]+)", text, re.MULTILINE)
    for requirement in CORE + (EXTRAS if lock == "dev" else []):
        versions = [version for name, version in locked if name == canonicalize_name(requirement.name)]
        assert versions, f"{requirement.name} is not locked: run .ci/lock"
        assert all(requirement.specifier.contains(v) for v in versions), f"{requirement}: run .ci/lock"
    assert "://" not in text
    entries = re.split(r"^(?=[a-z])", text, flags=re.MULTILINE)[1:]
    assert len(entries) == len(locked)
    assert all("--hash=sha256:" in entry for entry in entries)


def test_the_wheel_holds_everything_and_nothing_else(tmp_path):
    pytest.importorskip("hatchling")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, check=True, capture_output=True, cwd=ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    source = ROOT / "src"
    kept = {p.relative_to(source).as_posix() for p in (source / "gonio").rglob("*") if p.is_file()}
    assert held == {name for name in kept if "__pycache__" not in name}
    assert {"gonio/py.typed", "gonio/__init__.pyi"} <= held


def test_one_version_is_told_everywhere():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", citation, re.MULTILINE)[1] == gn.__version__
    assert f"## {gn.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_no_module_is_named_after_nothing():
    assert not {"utils", "util", "helpers", "common", "core", "misc"} & {p.stem for p in SOURCES}
    assert not {"utils", "util", "helpers", "common", "core", "misc"} & {p.parent.name for p in SOURCES}


def defined(source: Path) -> set[str]:
    """The names of functions, classes, parameters and fields that `source` defines."""
    names = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names


@pytest.mark.parametrize("source", SOURCES, ids=lambda p: p.relative_to(ROOT / "src").as_posix())
def test_a_file_is_finished_and_spelt_the_british_way(source):
    text = source.read_text(encoding="utf-8")
    assert not re.search(r"\b(TODO|FIXME|XXX)\b|NotImplementedError|/home/|/Users/", text)
    american = re.compile(r"color|center|normaliz|neighbor|behavior|optimiz", re.IGNORECASE)
    assert not {name for name in defined(source) if american.search(name)}
