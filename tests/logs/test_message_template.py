"""Messages filled from a template say what messages made one by one would say."""

from __future__ import annotations

import numpy as np
import pytest
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given
from hypothesis import strategies as st
from pushplan.logging.old.message_template import MessageTemplate
from pushplan.logging.old.messages.schemas import MessageClass, Twist


def twist(stamp: Timestamp, numbers: list[float]) -> MessageClass:
    vx, vy, omega = numbers
    return Twist(timestamp=stamp, frame_id="chain", vx=vx, vy=vy, omega=omega)


NUMBERS = st.floats(allow_nan=False, width=64)
SAMPLES = st.lists(
    st.tuples(st.integers(0, (1 << 33) * 10**9), NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=5
)


@given(SAMPLES)
def test_a_filled_message_is_the_message(samples: list[tuple[int, float, float, float]]) -> None:
    times = np.array([time for time, *_ in samples])
    numbers = np.array([values for _, *values in samples])
    rows = MessageTemplate(twist, 3).fill(times, numbers)
    assert len(rows) == len(samples)
    for row, (time, *values) in zip(rows, samples, strict=True):
        stamp = Timestamp(seconds=time // 10**9, nanos=time % 10**9)
        assert Twist.FromString(row.tobytes()) == twist(stamp, values)


def test_not_a_number_keeps_its_bits() -> None:
    numbers = np.array([[np.nan, np.inf, -0.0]])
    (row,) = MessageTemplate(twist, 3).fill(np.array([0]), numbers)
    message = Twist.FromString(row.tobytes())
    assert np.array([message.vx, message.vy, message.omega]).tobytes() == numbers.tobytes()


def test_a_message_that_drops_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match="a message holds 0 times what it should hold once"):
        MessageTemplate(lambda stamp, numbers: Twist(timestamp=stamp, vx=numbers[0]), 2)
