"""Ctrl-C during the import of a C++ module, where an exception would end the process."""

import subprocess
import sys

import pytest

PROGRAM = """\
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)

def called_while(frame):
    while frame is not None:
        if frame.f_code.co_name in ("create_module", "exec_module"):
            if getattr(frame.f_locals.get("self"), "name", "") == {module!r}:
                return True
        frame = frame.f_back
    return False

def profile(frame, event, argument):
    if event == "call" and frame.f_code.co_filename.endswith("enum.py") and called_while(frame.f_back):
        sys.setprofile(None)
        os.kill(os.getpid(), signal.SIGINT)

sys.setprofile(profile)
try:
    import pushplan.planners.timing.exact_timing, pushplan.ompl
except KeyboardInterrupt:
    print("interrupted", {module!r} in sys.modules)
"""


@pytest.mark.parametrize("module", ["pushplan.core", "ompl._ompl", "ruckig"])
def test_an_interrupt_waits_until_a_module_in_cpp_is_imported(module: str) -> None:
    command = [sys.executable, "-c", PROGRAM.format(module=module)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "interrupted True\n"), done.stderr[-1000:]
