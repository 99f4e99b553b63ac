"""CAN frames for the tests of slcan."""

from __future__ import annotations

import can
from hypothesis import strategies as st

from drivers.transports.can_frame import CanFrame


@st.composite
def frames(draw):
    extended, remote = draw(st.booleans()), draw(st.booleans())
    data = draw(st.binary(max_size=8))
    return can.Message(
        arbitration_id=draw(st.integers(0, (1 << (29 if extended else 11)) - 1)),
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=len(data),
        data=None if remote else data,
        check=True,
    )


def same(one, other):
    one, other = (f.message() if isinstance(f, CanFrame) else f for f in (one, other))
    return one.equals(other, timestamp_delta=None)
