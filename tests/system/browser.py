"""A headless Chromium driven over its DevTools pipe; nothing but the browser itself is needed."""

import base64
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

AXE = Path(__file__).parent / "axe" / "node_modules" / "axe-core" / "axe.min.js"
needs_axe = pytest.mark.skipif(not AXE.is_file(), reason="no axe here: `make test` installs it")
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-background-networking",
    "--remote-debugging-pipe",
)


def find_browser():
    """Return the path of a Chromium, the one named by BROWSER first, or None."""
    return next(filter(None, map(shutil.which, (os.environ.get("BROWSER", ""), *NAMES))), None)


class Tab:
    """One page of a browser; `errors` is what its console complained of, `asked` what it loaded."""

    def __init__(self, reader, writer):
        self._reader, self._writer = reader, writer
        self._left, self._number, self._session = b"", 0, None
        self.errors, self.asked = [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """Call a DevTools method and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._writer, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + 60.0
        while True:
            answer = self._read(deadline)
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer.get('error')}"
                return answer["result"]
            self._note(answer)

    def _read(self, deadline):
        while b"\0" not in self._left:
            ready, _, _ = select.select([self._reader], [], [], max(deadline - time.monotonic(), 0))
            chunk = os.read(self._reader, 1 << 20) if ready else b""
            assert chunk, "the browser does not answer"
            self._left += chunk
        message, self._left = self._left.split(b"\0", 1)
        return json.loads(message)

    def _note(self, event):
        method, facts = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(facts["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and facts["type"] in ("error", "assert"):
            self.errors.append(json.dumps(facts["args"]))
        elif method == "Log.entryAdded" and facts["entry"]["level"] == "error":
            self.errors.append(facts["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.asked.append(facts["request"]["url"])

    def screen(self, width, height, dark=False, scale=1):
        """Set the size of the screen and whether it is dark."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=scale,
            mobile=False,
        )
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[theme])

    def open(self, url):
        """Load a page and wait until it can be asked."""
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && window.splinefleet")
        self.settle()

    def run(self, script):
        """Return what a JavaScript expression (or promise) gives."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def wait(self, condition, seconds=30.0):
        """Wait until a JavaScript condition holds; fail after the deadline."""
        deadline = time.monotonic() + seconds
        while not self.run(f"Boolean({condition})"):
            assert time.monotonic() < deadline, f"not within {seconds} s: {condition}"
            self.settle()

    def settle(self):
        """Wait until two frames have been drawn."""
        self.run("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")

    def press(self, key, text=""):
        """Press a key."""
        facts = {"key": key, "text": text} if text else {"key": key}
        self.call("Input.dispatchKeyEvent", type="keyDown", **facts)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)
        self.settle()

    def point(self, x, y, kind="mouseMoved"):
        """Move the pointer (or press, release its button) there."""
        button = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **button)
        self.settle()

    def wheel(self, x, y, by):
        """Turn the wheel there; `by` pixels down."""
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=by)
        self.settle()

    def drag(self, begin, end):
        """Press at a place, move to another in steps, release."""
        self.point(*begin, "mousePressed")
        for part in (0.25, 0.5, 0.75, 1.0):
            x, y = (a + part * (b - a) for a, b in zip(begin, end, strict=True))
            held = {"button": "left", "buttons": 1}
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, **held)
        self.point(*end, "mouseReleased")

    def pinch(self, one, other, one_end, other_end):
        """Put two fingers on the screen, move both, lift them."""
        self.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
        for kind, part in (("touchStart", 0.0), *(("touchMove", i / 8) for i in range(1, 9))):
            points = [
                {"id": number, "x": a[0] + part * (b[0] - a[0]), "y": a[1] + part * (b[1] - a[1])}
                for number, (a, b) in enumerate(((one, one_end), (other, other_end)))
            ]
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
            self.settle()
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.call("Emulation.setTouchEmulationEnabled", enabled=False)
        self.settle()

    def layouts(self):
        """Return how often the page has been laid out since it was loaded."""
        self.call("Performance.enable")
        found = self.call("Performance.getMetrics")["metrics"]
        return next(one["value"] for one in found if one["name"] == "LayoutCount")

    def violations(self):
        """Return what axe finds that keeps people out: rules, and where they are broken."""
        self.run(AXE.read_text() + "; true")
        found = self.run("axe.run(document, {resultTypes: ['violations']})")
        return [(one["id"], [n["target"] for n in one["nodes"]]) for one in found["violations"]]

    def picture(self, path):
        """Write a picture of what is seen."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))


@contextlib.contextmanager
def browser(folder, kind=Tab):
    """Start a browser that keeps its things in a folder, and end it; `kind`: that of its tab."""
    down, up = os.pipe(), os.pipe()

    def connect():
        # The browser reads commands on 3 and answers on 4; both ends may sit there already.
        reader, writer = os.dup(down[0]), os.dup(up[1])
        reader, writer = os.dup2(reader, 103), os.dup2(writer, 104)
        os.dup2(reader, 3)
        os.dup2(writer, 4)

    process = subprocess.Popen(
        [find_browser(), *OPTIONS, f"--user-data-dir={folder}"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=connect,
        close_fds=False,
        start_new_session=True,
    )
    os.close(down[0])
    os.close(up[1])
    try:
        yield kind(up[0], down[1])
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        os.close(up[0])
        os.close(down[1])
