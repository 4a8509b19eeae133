"""MuJoCo, the optional physics engine: imported when it is first needed."""

from __future__ import annotations

from typing import Any

from pushplan.errors import PushplanError

EXTRA = "physics"
"""Extra of the package that brings the engine."""


class MissingEngineError(PushplanError, ImportError):
    """A physics simulation was asked for and its engine is not installed."""


class PhysicsError(PushplanError):
    """A physics simulation is impossible or did not stay finite."""


def engine() -> Any:
    """Return the module `mujoco`.

    Raises:
        MissingEngineError: When it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise MissingEngineError(
            f"a physics simulation needs MuJoCo, which is not installed: pip install 'pushplan[{EXTRA}]'"
        ) from error
    return mujoco
