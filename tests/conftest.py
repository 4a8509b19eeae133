"""Chains for many tests, built without scenario files."""

import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType
from typing import TypeVar

# Its threads spin while they wait, which took up to six times the work on these small matrices.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# If it is set, each of the hundreds of processes that tests start compiles all of pushplan again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.util.arrays import FloatArray

_exit_code = pytest.StashKey[int]()

# Hypothesis fails a test if an example takes longer than 0.2 s, or if its generation is slow. The first example
# includes imports, and test machines are often busy.
settings.register_profile(
    "patient", settings(), max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("patient")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Run three files on two processors, because many tests wait for their own processes."""
    return max(1, 3 * (os.cpu_count() or 1) // 2)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order the files so that no worker is left alone at the end: long files first, then those with few tests."""
    tests, order = Counter(item.path for item in items), {name: k for k, name in enumerate(LONG)}
    items.sort(key=lambda item: (order.get(item.path.stem, len(LONG)), tests[item.path]))


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Store the exit status of the run."""
    session.config.stash[_exit_code] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End the process before OMPL's bindings print pages about leaks below pytest's summary."""
    if "ompl" in sys.modules and not hasattr(config, "workerinput"):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash.get(_exit_code, 1))


Value = TypeVar("Value")
Captured = pytest.CaptureFixture[str]
Patch = pytest.MonkeyPatch

LONG = [
    "test_docs",
    "test_controller",
    "test_every_kind",
    "test_store",
    "test_batch",
    "test_run",
    "test_forgeries",
    "test_stall",
    "test_screens",
    "test_rewritten",
    "test_trials",
    "test_core_calls",
    "test_view",
    "test_lower_bound",
    "test_suite",
]
"""Files that take 70 to 8 s, the longest first."""


def there(value: Value | None) -> Value:
    """Return a value that must not be None."""
    assert value is not None
    return value


def identify_roughly(patch: Patch) -> None:
    """Identify with few samples, members and starts: intervals of a few unknowns are as long."""
    patch.setattr("pushplan.sim.identify.posterior.ENOUGH", 50.0)
    patch.setattr("pushplan.sim.identify.posterior.MEMBERS", 20)
    patch.setattr("pushplan.sim.identify.posterior._LOOK", 30)
    patch.setattr("pushplan.sim.identify.identify.LOOKED_AT", 32)
    patch.setattr("pushplan.sim.identify.identify.STARTS", 2)


def heed_interrupts() -> None:
    """Let Ctrl-C end the next program (for `preexec_fn`), because shells let their children ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def calls_of(work: Callable[[], object], name: str = "") -> int:
    """Return the number of function calls, or of those with a name, until the work ends or is refused."""
    count = 0

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event == "call" and frame.f_code.co_qualname == name if name else event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    except PushplanError:
        pass
    finally:
        sys.setprofile(before)
    return count


PLATE_OUTLINE = np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]])


@dataclass(frozen=True)
class ChainMaker:
    """Builds chains; every method returns a new one."""

    def box(self, length: float = 0.1, width: float = 0.1) -> FloatArray:
        """Return the outline (4, 2) of a box about its centre."""
        return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * [length / 2, width / 2]

    def boxes(
        self,
        n: int = 3,
        size: tuple[float, float] = (0.1, 0.1),
        contact_friction: float = 0.3,
        pusher_friction: float = 0.5,
        floor_friction: float = 0.3,
        contact_height: float = 0.0,
        support: Callable[[FloatArray], Support] = UniformSupport,
    ) -> Chain:
        """Return n equal boxes in a row, flush and centred in front of the plate."""
        outline, objects, contacts = self.box(*size), [], []
        for i, mu in enumerate([pusher_friction, *[contact_friction] * (n - 1)]):
            pose = np.array([(i + 0.5) * size[0], 0.0, 0.0])
            objects.append(PushedObject(f"box{i}", outline, 1.0, floor_friction, support(outline), pose))
            right, left = (np.array([i * size[0], side * size[1] / 2]) for side in (-1.0, 1.0))
            contacts.append(Contact(right, left, mu, i, i - 1))
        return Chain(tuple(objects), tuple(contacts), Pusher(PLATE_OUTLINE, pusher_friction, contact_height))

    def star(self, rng: np.random.Generator, corners: int, size: float = 0.05) -> FloatArray:
        """Return the outline of a star-shaped, mostly non-convex polygon about the origin."""
        angle = 2.0 * np.pi * (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) / corners
        radius = size * rng.uniform(0.4, 1.0, corners)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)

    def random(self, seed: int, n: int, tree: bool = False, feet: bool = False) -> Chain:
        """Return n random objects roughly in a row; contacts and objects need not touch, because mechanics does not
        check it.
        """
        rng = np.random.default_rng(seed)
        objects, contacts = [], []
        for i in range(n):
            outline = self.star(rng, int(rng.integers(3, 9)))
            pose = np.array([0.1 * i + 0.05, rng.uniform(-0.02, 0.02), rng.uniform(-np.pi, np.pi)])
            mass, friction = float(rng.uniform(0.3, 2.0)), float(rng.uniform(0.1, 0.6))
            support: Support = UniformSupport(outline)
            if feet:
                support = FeetSupport(outline, rng.dirichlet(np.full(len(outline), 2.0)))
            objects.append(PushedObject(f"object{i}", outline, mass, friction, support, pose))
            middle = np.array([0.1 * i, rng.uniform(-0.01, 0.01)])
            half = rotate(rng.uniform(-0.1, 0.1), [0.0, rng.uniform(0.02, 0.05)])
            pusher = int(rng.integers(PLATE, i)) if tree and i else i - 1
            contacts.append(Contact(middle - half, middle + half, float(rng.uniform(0.1, 0.8)), i, pusher))
        return Chain(tuple(objects), tuple(contacts), Pusher(PLATE_OUTLINE, 0.5))


def pressure_of(rng: np.random.Generator, outline: FloatArray, center: FloatArray) -> FeetSupport:
    """Return a random load on five points of a box with a given centre (2,)."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    while True:
        points, shares = rng.uniform(low, high, (4, 2)), rng.dirichlet(np.ones(5))
        last = (center - shares[:4] @ points) / shares[4]
        if (last >= low).all() and (last <= high).all():
            return FeetSupport(np.vstack([points, last]), shares)


@pytest.fixture(scope="session", autouse=True)
def _recorded_runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the runs that tests and their processes record out of the user's home."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PUSHPLAN_RUNS", str(tmp_path_factory.mktemp("runs")))
        yield


@pytest.fixture(scope="session")
def make_chain() -> ChainMaker:
    """Return the maker of chains."""
    return ChainMaker()
