"""The package's public face: names, laziness, and what importing it must not do."""

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


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_exists_where_its_module_defines_it(name: str) -> None:
    value = getattr(pushplan, name)
    if name != "__version__":
        assert not isinstance(value, ModuleType)
        assert getattr(import_module(value.__module__), name) is value
    assert name in dir(pushplan)


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
