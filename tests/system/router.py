"""A router as a process of its own, as zenohd is: `python -m tests.system.router ENDPOINT`.

It has the settings that docs/deploy/router.json5 gives to zenohd, but for where it listens.
"""

import contextlib
import json
import signal
import sys
import threading

import zenoh

from tests.system.fleet_tools import ROOT, line_with, running

CONFIG = ROOT / "docs" / "deploy" / "router.json5"


@contextlib.contextmanager
def router(endpoint):
    """Start a router and wait until it listens; whatever is left of it is killed."""
    with running(sys.executable, "-m", "tests.system.router", endpoint) as process:
        line_with(process, "listening")
        yield process


def main(endpoint):
    """Route until told to end."""
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    config = zenoh.Config.from_file(str(CONFIG))
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    with zenoh.open(config):
        sys.stdout.write("listening\n")
        sys.stdout.flush()
        over.wait()


if __name__ == "__main__":
    main(sys.argv[1])
