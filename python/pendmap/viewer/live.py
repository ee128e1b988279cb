"""A trajectory sent to a running viewer during its computation."""

from __future__ import annotations

import math
import socket
import uuid
from typing import TYPE_CHECKING, Final

import numpy as np

from pendmap.errors import InputError, ViewerError
from pendmap.viewer import recording, trajectory

if TYPE_CHECKING:
    import rerun as rr
    import xarray as xr

    from pendmap.charts.marks import Floats
    from pendmap.model import Pendulum, Rig

ADDRESS: Final = "127.0.0.1:9876"  # Default address of a viewer

BLOCK: Final = 1000  # Least number of samples sent at a time
_PROBE: Final = 2.0
_FLUSH: Final = 20.0
_LATER: Final = 1000  # Positions of the pendulum in each block of a long trajectory
_PORTS: Final = 65_535


class NobodyListensError(ViewerError):
    """No viewer listens at an address."""


def check_address(address: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``; raise an error if no viewer listens there."""
    host, colon, port = address.rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) <= _PORTS):
        raise InputError(f"address must be HOST:PORT, such as {ADDRESS}, got {address!r}")
    host = host.strip("[]")
    try:
        # Without a listener the library would block for 15 seconds.
        with socket.create_connection((host, int(port)), _PROBE):
            pass
    except OSError as error:
        raise NobodyListensError(
            f"no viewer listens at {address} ({error.strerror or error}): start one with "
            f"'rerun --bind {host} --port {port}'"
        ) from None
    return host, int(port)


class Live:
    """Sender of a trajectory's samples to a viewer, in blocks; the ``live`` of pendmap.simulate."""

    def __init__(
        self, model: Pendulum | Rig, start: tuple[float, float], address: str = ADDRESS
    ) -> None:
        host, port = check_address(address)
        self._attrs = dict(model.attributes)
        self._period = model.period
        fastest = max(abs(start[1]), 2 * math.sqrt(1 + abs(model.p)) * model.units.w0)
        self._around = trajectory.places(self._attrs, np.array([-fastest, fastest]))
        self._waiting: list[Floats] = []
        self._before = np.empty((3, 0))
        self._sent = 0
        # A new name each time: the viewer merges recordings of equal name.
        self._stream: rr.RecordingStream = recording.identified(uuid.uuid4().hex)
        with recording.strict():
            url = f"rerun+http://{f'[{host}]' if ':' in host else host}:{port}/proxy"
            layout = trajectory.layout(self._attrs, self._around)
            self._stream.connect_grpc(url, default_blueprint=layout)
            self._stream.send_recording_name(f"trajectory: {model.title}")
            trajectory.still(self._stream, self._around)
            recording.text(self._stream, "summary", f"{model.title}\n\nRunning.")

    def __call__(self, time: Floats, theta: Floats, velocity: Floats) -> None:
        """Collect samples; send them once there are enough."""
        self._waiting.append(np.stack([time, theta, velocity]))
        if sum(part.shape[1] for part in self._waiting) >= BLOCK:
            self._send()

    def finish(self, dataset: xr.Dataset) -> None:
        """Send the waiting samples, the end of the phase curve and the summary."""
        self._send()
        motion = trajectory.motion_of(dataset)
        with recording.strict():
            self._frame(motion[2])
            trajectory.curve(self._stream, motion)
            trajectory.page(self._stream, dataset)
        try:
            self._stream.flush(timeout_sec=_FLUSH)
        except (RuntimeError, ValueError, TimeoutError) as error:
            raise ViewerError(f"the viewer did not accept all data sent: {error}") from None
        finally:
            self._stream.disconnect()

    def _send(self) -> None:
        if not self._waiting:
            return
        time, _, velocity = block = np.concatenate(self._waiting, axis=1)
        self._waiting = []
        trajectory.refuse_beyond(time, velocity)
        with recording.strict():
            fastest = float(np.abs(velocity).max())
            if fastest > self._around[0].y[1]:
                self._frame(1.5 * fastest * np.array([-1.0, 1.0]))
            early = self._sent < trajectory.MOVING
            bins = trajectory.BINS if early else _LATER
            trajectory.series(self._stream, self._attrs, block, bins)
            whole, since = np.concatenate([self._before, block], axis=1), self._before.shape[1]
            every = 1 if early else -(-time.size // _LATER)
            trajectory.moving_parts(self._stream, self._attrs, whole, since=since, every=every)
            period = np.round(time / self._period).astype(np.int64)
            once = np.abs(time / self._period - period) < 1e-9 * (1 + np.abs(period))
            trajectory.section(self._stream, time[once], block[1:, once], period[once])
        self._sent += time.size
        trail = int(trajectory.behind(self._attrs, whole[0])[0]) + 1
        self._before = whole[:, -trail:]

    def _frame(self, velocity: Floats) -> None:
        """Draw the frames anew, for these velocities."""
        self._around = trajectory.places(self._attrs, velocity)
        trajectory.still(self._stream, self._around)
        self._stream.send_blueprint(trajectory.layout(self._attrs, self._around))
