"""How much work something is, whatever the speed of the machine."""

import sys
from collections.abc import Callable

from pushplan.errors import PushplanError


def calls_of(work: Callable[[], object]) -> int:
    """Return how many functions are called until the work is done, or refused."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    except PushplanError:
        pass
    finally:
        sys.setprofile(before)
    return count
