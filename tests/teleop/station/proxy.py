"""UDP proxy between two stations in other processes, which delays, loses, doubles and forges."""

from __future__ import annotations

import heapq
import random
import select
import socket
import threading
import time
from typing import Self

from teleop.safety import Mode
from teleop.station.datagram import SIZE

MODE = 4
"""Byte of a datagram of a tick with the mode of its sender."""


class Proxy:
    """Passes datagrams between a master, which connects to `address`, and a slave at `port`."""

    def __init__(self, port, delay=0.0, jitter=0.0, loss=0.0, doubled=0.0, replayed=0, seed=0):
        self._slave = ("127.0.0.1", port)
        self._master = None
        self._delay, self._jitter, self._loss, self._doubled = delay, jitter, loss, doubled
        self._replayed = replayed
        self._random = random.Random(seed)
        self.cut = False
        self.modes = {"master": Mode.DISCONNECTED, "slave": Mode.DISCONNECTED}
        self.active = {"master": 0, "slave": 0}
        """Number of datagrams of each station while it was active."""
        self._here = socket.socket(type=socket.SOCK_DGRAM)
        self._here.bind(("127.0.0.1", 0))
        self._there = socket.socket(type=socket.SOCK_DGRAM)
        self._there.bind(("127.0.0.1", 0))
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._queue = []
        self._old = {"master": [], "slave": []}

    @property
    def address(self):
        return f"127.0.0.1:{self._here.getsockname()[1]}"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()
        self._here.close()
        self._there.close()

    def _run(self):
        number = 0
        while not self._end.is_set():
            due = self._queue[0][0] - time.monotonic() if self._queue else 0.1
            ready, _, _ = select.select([self._here, self._there], [], [], max(0.0, min(due, 0.1)))
            for end in ready:
                side = "master" if end is self._here else "slave"
                data, place = end.recvfrom(2048)
                if side == "master":
                    self._master = place
                for sent in self._passed(side, data):
                    arrival = time.monotonic() + self._delay + self._jitter * self._random.random()
                    number += 1
                    heapq.heappush(self._queue, (arrival, number, side, sent))
            while self._queue and self._queue[0][0] <= time.monotonic():
                _, _, side, data = heapq.heappop(self._queue)
                if side == "master":
                    self._there.sendto(data, self._slave)
                elif self._master:
                    self._here.sendto(data, self._master)

    def _passed(self, side, data):
        """Yield what arrives instead of a datagram."""
        if len(data) == SIZE:
            self.modes[side] = Mode(data[MODE])
            self.active[side] += data[MODE] == Mode.ACTIVE
        if self.cut:
            return
        draw = self._random.random
        if draw() >= self._loss:
            yield data
        if draw() < self._doubled:
            yield data
        old = self._old[side]
        if self._replayed:
            old.append(data)
            for _ in range(self._replayed):
                yield self._random.choice(old)
