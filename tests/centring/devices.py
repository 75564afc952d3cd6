"""Indicators on pseudo-terminals and a controller on loopback TCP, speaking the bytes of the real ones."""

import contextlib
import os
import select
import socket
import threading
import time

import numpy as np

from planner.centring.robot_link import centring_program
from planner.centring.settings import RobotSettings
from tests.centring.krl import Program, text_of, value_of
from tests.centring.world import pose, shifted
from tests.not_everywhere import tty


def sylvac(value):
    return f"{value:+09.4f}\r".encode()


def mitutoyo(value, channel):
    return f"0{channel}A{value:+09.3f}\r".encode()


class Terminal:
    """Something that answers on a pseudo-terminal: ``reply(request)`` gives the bytes, ``lose`` a share of them."""

    def __init__(self, reply, lose=0.0, seed=0):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        self.reply, self.lose = reply, lose
        self.rng, self.silent, self.lost = np.random.default_rng(seed), False, 0
        self._wake, self._end = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        asked = b""
        while True:
            ready, _, _ = select.select([self.master, self._wake], [], [])
            if self._wake in ready:
                return
            asked += os.read(self.master, 64)
            while b"\r" in asked:
                request, _, asked = asked.partition(b"\r")
                if not self.silent:
                    kept = bytes(b for b in self.reply(request) if self._passes())
                    os.write(self.master, kept)

    def _passes(self):
        lost = bool(self.rng.random() < self.lose)
        self.lost += lost
        return not lost

    def unplug(self):
        self.close()

    def close(self):
        if self._thread is not None:
            os.write(self._end, b"x")
            self._thread.join()
            self._thread = None
            for end in (self.master, self.slave, self._wake, self._end):
                os.close(end)


def indicator(world, k, **how):
    return Terminal(lambda request: sylvac(world.shown(k)) if request == b"?" else b"ERR1\r", **how)


def multiplexer(world, **how):
    def reply(request):
        channel = int(request)
        return mitutoyo(world.shown(channel - 1), channel)

    return Terminal(reply, **how)


class Controller:
    """KUKAVARPROXY on a controller that runs the shipped KRL and moves ``world``.

    ``faults``: ``cut`` the connection when that order begins, ``deaf`` from that order on, ``slow`` seconds that a move
    takes (with ``cut``: that move alone), ``idle`` (the program does not run), ``silence`` that it bears,
    ``short`` (the status is not counted in an answer's length).
    """

    def __init__(self, world, **faults):
        self.world, self.faults = world, faults
        files = centring_program(RobotSettings(silence_s=faults.get("silence", 3.0)))
        own = faults.get("program", "")  # of the plan, which calls CENTRE
        self.krl = Program(files["EDBB_CENTRE.src"] + own, files["EDBB_CENTRE.dat"], self)
        self.values = self.krl.values
        self.values |= {"EDBB_GO": 7, "EDBB_STOP": True}  # what an earlier session left
        self.orders, self.speeds, self.starts = [], [], []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.address = f"tcp://127.0.0.1:{self.server.getsockname()[1]}"
        self.open = True
        self.connections = []
        self.threads = [threading.Thread(target=t, daemon=True) for t in (self._accept, self._works)]
        for thread in self.threads[: 1 if faults.get("idle") else 2]:
            thread.start()

    def close(self):
        self.open = self.krl.alive = False
        self.server.close()
        self.cut()
        if not self.faults.get("idle"):
            self.threads[1].join()

    def cut(self):
        for connection in self.connections:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()

    # the proxy

    def _accept(self):
        while self.open:
            try:
                connection, _ = self.server.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        data = b""
        while True:
            try:
                more = connection.recv(4096)
            except OSError:
                return
            if not more:
                return
            data += more
            while len(data) >= 4 and len(data) >= 4 + data[2] * 256 + data[3]:
                size = data[2] * 256 + data[3]
                message, data = data[: 4 + size], data[4 + size :]
                try:
                    self._answer(connection, message)
                except OSError:
                    return

    def _answer(self, connection, message):
        mode, length = message[4], message[5] * 256 + message[6]
        name = message[7 : 7 + length].decode("ascii")
        if mode == 1:
            rest = message[7 + length :]
            value = rest[2:].decode("ascii")
            assert rest[0] * 256 + rest[1] == len(value)
            ok = name in self.values or name == "$TIMER[10]"
            if name == "$TIMER[10]":
                self.krl.timer = time.monotonic() - int(value) / 1000
            elif ok:
                self.values[name] = value_of(value)
        else:
            assert len(message) == 7 + length
            value = self._value(name) or ""  # as the real one: what does not exist is nothing, done
            ok = True
        if self.faults.get("deaf") is not None and len(self.orders) >= self.faults["deaf"]:
            return
        body = (
            bytes([mode, len(value) // 256, len(value) % 256])
            + value.encode()
            + (b"\x00\x01\x01" if ok else b"\x00\x00\x00")
        )
        length = len(body) - (3 if self.faults.get("short") else 0)
        answer = message[:2] + bytes([length // 256, length % 256]) + body
        cut = len(answer) // 2  # an answer may come in pieces
        connection.sendall(answer[:cut])
        connection.sendall(answer[cut:])

    def _value(self, name):
        if name == "$AXIS_ACT":
            return self._axes(self.world.q_set)
        if name == "$AXIS_ACT_MEAS":
            return self._axes(self.world.q)
        if name == "$POS_ACT":
            x, R = pose(self.world.q_set)
            a = np.arctan2(R[1, 0], R[0, 0])
            b = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
            c = np.arctan2(R[2, 1], R[2, 2])
            parts = dict(zip("XYZABC", [*x, *np.rad2deg([a, b, c])], strict=True))
            return "{E6POS: " + ", ".join(f"{k} {v:.5f}" for k, v in parts.items()) + ", S 2, T 10, E1 0.0}"
        return text_of(self.values[name]) if name in self.values else None

    @staticmethod
    def _axes(q):
        return "{E6AXIS: " + ", ".join(f"A{j + 1} {a:.6f}" for j, a in enumerate(q)) + ", E1 12.5, E2 0.0}"

    def _works(self):
        self.krl.run("PLANNED" if self.faults.get("program") else "EDBB_CENTRE")

    # the arm, as the program moves it

    def ptp(self, axes):
        self.speeds.append(self.values["EDBB_VEL"])
        self.starts.append(self.world.q_set.copy())
        return self._going("1", axes, np.array([axes[f"A{j}"] for j in range(1, 7)]))

    def lin_rel(self, frame):
        return self._going("2", frame, shifted(self.world.q_set, np.array([frame[k] for k in "XYZ"])))

    def _going(self, kind, target, goal):
        self.orders.append((kind, target))
        last = self.faults.get("slow", 0.004)
        if self.faults.get("cut") == len(self.orders):
            self.cut()
        elif "cut" in self.faults:
            last = 0.004
        start, begun = self.world.q_set, time.monotonic()
        while (share := (time.monotonic() - begun) / last) < 1.0:
            q = start + share * (goal - start)
            self.world.place(q, q)
            time.sleep(0.001)
            yield
        self.world.land(goal)
