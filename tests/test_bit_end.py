"""The end of the bit: beside a socket it stands on the head, over it it goes in."""

from __future__ import annotations

import numpy as np
import pytest
from thread_rig import BOLT, ThreadRig

FIND_SPEED = 3.0  # [rad/s]
DEEP = 1.8e-3  # From the top of the M3 head to the bit's end when it is in [m].


def lowered(rig: ThreadRig, off: float, speed: float) -> float:
    """Bring the bit down beside the socket [m] and let it turn [rad/s].

    Returns:
        How far above its seat its end comes to stand [m].
    """
    seat = rig.seated_bit
    rig.put_bit(seat + [off, 0.0, 0.004])
    rig.driver.command(rig.root, speed)
    for _ in range(600):
        rig.move_bit(-0.02 if rig.p_WE[2] > seat[2] else 0.0)
        rig.step()
    return float(rig.bit.CalcPoseInWorld(rig.context).translation()[2] - seat[2])


@pytest.mark.parametrize("off", [6e-4, 1.5e-3])
def test_bit_beside_the_socket_stands_on_the_head(off: float) -> None:
    rig = ThreadRig()
    assert lowered(rig, off, FIND_SPEED) == pytest.approx(DEEP, abs=2e-5)
    assert rig.driver.push(rig.context) == pytest.approx(2e3 * DEEP, rel=0.02)
    assert not rig.threads.bit_engaged(rig.root, BOLT)
    # Lifted and set down over the socket, it drops in.
    p_WF = rig.thread.bolt.body_frame().CalcPoseInWorld(rig.context).translation()
    aside = float(np.hypot(*(p_WF - rig.seated_bit)[:2]))
    assert aside < 1e-3
    assert lowered(rig, float((p_WF - rig.seated_bit)[0]), FIND_SPEED) < 1e-4
    assert rig.threads.bit_engaged(rig.root, BOLT)


def test_bit_over_the_socket_goes_in_untouched() -> None:
    rig = ThreadRig()
    assert abs(lowered(rig, 2e-4, 0.0)) < 2e-5
    assert abs(rig.driver.push(rig.context)) < 0.05


def test_what_touches_is_restored() -> None:
    """Also in the depth of a socket, where the shape would be inside of the head."""
    rig = ThreadRig()
    lowered(rig, 2e-4, 0.0)
    rows, p = rig.threads.save(rig.root), rig.p_WE.copy()
    rig.put_bit(p + [0.02, 0.0, 0.02])
    rig.step()
    rig.put_bit(p)
    rig.threads.restore(rig.root, rows)
    rig.step()
    assert abs(rig.driver.push(rig.context)) < 0.05
