"""A router with keys, and the fleets, thieves and strangers that go there."""

from coordinator.security.key_store import KeyStore
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, Command, Hello, Plan, Report
from protocol.phases import IDLE
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import Inbox
from tests.system.fleet_tools import TWO_ROBOTS, splinefleet, started, wait_for
from tests.system.locked_fleet import NOW, Events, Keys, locked_endpoint, scenario_in
from tests.system.router import router

YARD = "yard"
HELLO = encode(Hello(version=PROTOCOL_VERSION, boot=4))


class LockedHall:
    """A router with keys for the fleets `two` (R1, R2) and `yard` (Y1, Y2), and who goes there."""

    def __init__(self, stack, folder):
        self.stack, self.folder = stack, folder
        self.keys, self.endpoint = Keys(folder), locked_endpoint()
        KeyStore(self.keys.folder).issue("robot", ["Y1", "Y2"], NOW, 365)
        self.two, self.yard = scenario_in(folder), folder / "yard.toml"
        text = TWO_ROBOTS.replace('"two"', f'"{YARD}"')
        self.yard.write_text(text.replace('"R1"', '"Y1"').replace('"R2"', '"Y2"'))
        self.config = folder / "router.json5"
        self.write("--host", "localhost")
        self.router = self.start_router()

    def write(self, *more):
        options = ["--keys", self.keys.folder, "--listen", self.endpoint, "-o", self.config]
        done = splinefleet("keys", "router", self.two, self.yard, *options, *more)
        assert done.returncode == 0, done.stderr

    def start_router(self):
        return self.stack.enter_context(router(self.endpoint, self.config))

    def start(self, *arguments):
        return self.stack.enter_context(started(*arguments, "--connect", self.endpoint))

    def coordinator(self, scenario, *more):
        options = ["--keys", self.keys.folder, "--json", "--wait", 600]
        events = Events(self.start("coordinator", scenario, *options, *more))
        events.wait(lambda event: event["event"] == "listening")
        return events

    def connect(self, role, name=""):
        return self.connect_with(self.keys.of(role, name))

    def connect_with(self, files, timeout_s=5.0):
        return self.stack.enter_context(
            ZenohTransport.connect(self.endpoint, timeout_s=timeout_s, whom="router", keys=files)
        )

    def hears(self, who, *expressions):
        inbox = Inbox()
        for expression in expressions:
            who.subscribe(expression, inbox)
        return inbox


def served(fleet, name, robot):
    """Let a robot introduce itself until its coordinator has given it a plan and a command."""
    inbox = Inbox()
    for expression in (keys.plan(fleet, name), keys.command(fleet)):
        robot.subscribe(expression, inbox)

    def is_served():
        robot.put(keys.hello(fleet, name), HELLO)
        robot.put(keys.report(fleet, name), encode(Report(4, 1, 1, IDLE)))
        kinds = {type(decode(keys.split(key)[1], payload)) for key, payload, _ in inbox.heard}
        return kinds >= {Plan, Command}

    wait_for(is_served)
