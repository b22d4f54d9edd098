"""A Chromium without a window, driven over its DevTools protocol with nothing but Python."""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import struct
import subprocess
import tempfile
import time
import urllib.request
from typing import Any

from program import Failed

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--window-size=1280,720",
    "--remote-debugging-port=0",
)  # fmt: skip

# Seconds that any answer may take.
LIMIT = 60.0


class WebSocket:
    """A client's end of a WebSocket that carries texts."""

    def __init__(self, port: int, path: str) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=LIMIT)
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection:"
            f" Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        self._bytes = b""
        while b"\r\n\r\n" not in self._bytes:
            self._receive()
        self._bytes = self._bytes.split(b"\r\n\r\n", 1)[1]

    def send(self, text: str) -> None:
        data, mask = text.encode(), os.urandom(4)
        if len(data) < 126:
            head = bytes([0x81, 0x80 | len(data)])
        elif len(data) < 1 << 16:
            head = b"\x81\xfe" + struct.pack(">H", len(data))
        else:
            head = b"\x81\xff" + struct.pack(">Q", len(data))
        self._socket.sendall(
            head + mask + bytes(byte ^ mask[at % 4] for at, byte in enumerate(data))
        )

    def receive(self) -> str:
        text = b""
        while True:
            first, second = self._take(2)
            length = second & 127
            if length == 126:
                (length,) = struct.unpack(">H", self._take(2))
            elif length == 127:
                (length,) = struct.unpack(">Q", self._take(8))
            text += self._take(length)
            if first & 0x80:
                return text.decode()

    def _take(self, count: int) -> bytes:
        while len(self._bytes) < count:
            self._receive()
        taken, self._bytes = self._bytes[:count], self._bytes[count:]
        return taken

    def _receive(self) -> None:
        more = self._socket.recv(1 << 16)
        if not more:
            raise Failed("Chromium ended the connection")
        self._bytes += more


class Chromium:
    """A browser with one page of so many pixels."""

    def __init__(self, address: str, pixels: tuple[int, int] = (1280, 720)) -> None:
        program = next((found for name in PROGRAMS if (found := shutil.which(name))), None)
        if program is None:
            raise Failed("Chromium is not installed")
        # Children of Chromium may still write when it has ended.
        self._profile = tempfile.TemporaryDirectory(
            prefix="bench-chromium-", ignore_cleanup_errors=True
        )
        command = [program, *FLAGS, f"--user-data-dir={self._profile.name}", address]
        self._process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._number = 0
        end = time.monotonic() + LIMIT
        port_file = os.path.join(self._profile.name, "DevToolsActivePort")
        target = None
        while target is None:
            if time.monotonic() > end:
                raise Failed("Chromium does not start")
            time.sleep(0.02)
            if os.path.exists(port_file) and (
                lines := open(port_file, encoding="utf-8").read().split()
            ):
                port = int(lines[0])
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                    target = next(
                        (found for found in json.load(answer) if found["type"] == "page"), None
                    )
        self._page = WebSocket(port, "/" + target["webSocketDebuggerUrl"].split("/", 3)[3])
        width, height = pixels
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        self._page.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._page.receive())
            if answer.get("id") == self._number:
                return answer.get("result", {})

    def value(self, expression: str) -> Any:
        """Returns an expression's value in the page; `None` if it fails."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        return result.get("result", {}).get("value")

    def wait(self, expression: str) -> None:
        """Waits until an expression is true in the page."""
        end = time.monotonic() + LIMIT
        while not self.value(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise Failed(f"`{expression}` does not become true in the page")
            time.sleep(0.01)

    def key(self, code: str, down: bool) -> None:
        self.call(
            "Input.dispatchKeyEvent", type="keyDown" if down else "keyUp", code=code,
            key=code[-1].lower()
        )

    def mouse(self, kind: str, x: int, y: int, buttons: int) -> None:
        button = "left" if buttons or kind == "mouseReleased" else "none"
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=buttons)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._profile.cleanup()
