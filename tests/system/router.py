"""A router as a process of its own, as zenohd is: `python -m tests.system.router ENDPOINT CONFIG`.

It has the settings of a file for zenohd, by default docs/deploy/router.json5, but for where it
listens.  What it refuses it writes to stdout, when RUST_LOG asks for it.
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
def router(endpoint, config=CONFIG):
    """Start a router and wait until it listens; whatever is left of it is killed."""
    command = (sys.executable, "-m", "tests.system.router", endpoint, str(config))
    with running(*command) as process:
        line_with(process, "listening")
        yield process


def main(endpoint, file):
    """Route until told to end."""
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    zenoh.init_log_from_env_or("error")
    config = zenoh.Config.from_file(file)
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    with zenoh.open(config):
        sys.stdout.write("listening\n")
        sys.stdout.flush()
        over.wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
