"""The package's public face: names, laziness, and what importing it must not do."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import pushplan

HEAVY = ("ompl", "matplotlib", "mcap", "shapely", "pydantic", "scipy", "ruckig", "numpy")
ROOT = Path(__file__).parents[1]
PUBLIC: list[str] = vars(pushplan)["__all__"]


def _statically_imported() -> set[str]:
    """Names that type checkers see: the imports under TYPE_CHECKING."""
    tree = ast.parse(Path(str(pushplan.__file__)).read_text())
    guarded = [node for node in tree.body if isinstance(node, ast.If)]
    imports = [node for block in guarded for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.name for node in imports for alias in node.names}


def test_all_names_are_the_statically_imported_ones_and_the_version() -> None:
    assert set(PUBLIC) == _statically_imported() | {"__version__"}
    assert len(set(PUBLIC)) == len(PUBLIC)


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_exists_where_its_module_defines_it(name: str) -> None:
    value = getattr(pushplan, name)
    if name != "__version__":
        assert not isinstance(value, ModuleType)
        assert getattr(import_module(value.__module__), name) is value
    assert name in dir(pushplan)


def test_type_checkers_find_the_installed_package() -> None:
    """They look along the paths; an editable install by an import hook has none (`tool.setuptools.package-dir`)."""
    code = (
        "import pathlib, sys; print(any((pathlib.Path(p) / 'pushplan/py.typed').is_file() for p in sys.path))"
    )
    done = subprocess.run([sys.executable, "-I", "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "True\n"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'pushplan' has no attribute 'pul'"):
        pushplan.pul  # noqa: B018


@pytest.mark.parametrize("first", ["import pushplan.run", "from pushplan.run import run", "pass"])
def test_functions_win_over_the_modules_of_their_name(first: str) -> None:
    code = f"{first}\nimport pushplan, pushplan.run\nassert callable(pushplan.run), pushplan.run"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def _modules_after(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("code", ["import pushplan", "from pushplan.cli.main import main; main(['--help'])"])
def test_importing_the_package_and_its_help_load_nothing_heavy(code: str) -> None:
    assert not _modules_after(code).intersection(HEAVY)


def test_pythons_own_logging_is_found_from_the_checkout() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import logging; logging.getLogger(); print(logging.__file__)"],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert Path(done.stdout.strip()).parent.name == "logging"
    assert ROOT not in Path(done.stdout.strip()).parents
