"""The shell of a MicroPython robot whose core is native code: splinefleet_core.mpy.

Decides: what lies where in the memory that both share (native/core.c).  It has the same methods and
results as Robot in robot.py, in float32, and reads Plans over several ticks.  Must not know: what
messages say.
"""

from collections.abc import Callable
from struct import pack_into, unpack_from

_SIZE = 0
_BEGIN = 1
_HEAR = 2
_TICK = 3
_SPEAK = 4
_FAILED = 5

_NUMBERS = "<qffff"
_KIND = 40
_PHASE = 60
_BYTES = 64
_LEAVES = 1
_READS = 2
_REFUSED = 4
_KINDS = ("", "hello", "plan", "command", "report", "clock")


class Robot:
    """A robot of a fleet, as Robot in robot.py; `core` is the function of splinefleet_core.

    The core states its sizes itself; `longest_plan` [bytes] must be the one that it states.

    After `tick`: phase and fault, drive_turn, drive_speed, drive_curvature and drive_distance, and
    `place` [m], how far it is on its course.  `agent` is the robot itself.
    """

    def __init__(
        self,
        core: Callable[[bytearray, bytearray, bytes, int], int],
        name: str,
        put: Callable[[str, bytes], None],
        boot: int,
        limits: tuple[float, float, float] = (0.0, 0.0, 0.0),
        period_ns: int = 10_000_000,
        longest_plan: int = 1_400,
    ) -> None:
        exchange = self._exchange = bytearray(_BYTES + 96)
        self._memory = bytearray(core(exchange, exchange, exchange, _SIZE))
        self._plan = bytearray(longest_plan)
        self._sent = memoryview(exchange)
        self._core, self._put = core, put
        self.agent = self
        self.refusal = None
        self.phase = self.fault = 0
        self.drive_speed = self.drive_curvature = self.drive_distance = self.drive_turn = 0.0
        self.place = 0.0
        pack_into(_NUMBERS, exchange, 0, period_ns, 0.0, 0.0, 0.0, limits[1])
        pack_into("<I", exchange, _KIND, boot)
        pack_into("<32sxxxxxxxxddd", exchange, _BYTES, name.encode(), *limits)
        core(self._memory, exchange, exchange, _BEGIN)

    def hear(self, kind: str, payload: bytes, now_ns: int) -> None:
        """Take in what came on a key of a kind: plan, command or clock.

        A Plan is ignored while another one is read, or if it is too long: it comes again.
        """
        exchange, read = self._exchange, payload
        if kind == "plan":
            if exchange[_PHASE + 2] & _READS or len(payload) > len(self._plan):
                return
            read = self._plan
            read[: len(payload)] = payload
        pack_into("<q", exchange, 0, now_ns)
        pack_into("<II", exchange, _KIND, _KINDS.index(kind), len(payload))
        self._core(self._memory, exchange, read, _HEAR)

    def tick(self, now_ns: int, x: float, y: float, heading: float) -> bool:
        """Let the robot at this pose [m, m, rad] decide and speak; False when it may end."""
        exchange, memory, core = self._exchange, self._memory, self._core
        pack_into("<qfff", exchange, 0, now_ns, x, y, heading)
        core(memory, exchange, exchange, _TICK)
        self.phase, self.fault = exchange[_PHASE], exchange[_PHASE + 1]
        driven = unpack_from("<fffff", exchange, 20)
        self.drive_speed, self.drive_curvature, self.drive_distance, self.drive_turn = driven[:4]
        self.place = driven[4]
        while kind := core(memory, exchange, exchange, _SPEAK):
            end = _BYTES + unpack_from("<I", exchange, _KIND + 4)[0]
            self._put(_KINDS[kind], bytes(self._sent[_BYTES:end]))
        flags = exchange[_PHASE + 2]
        if flags & _REFUSED:
            self.refusal = "refused"
        return not flags & (_LEAVES | _REFUSED)

    def hear_driver_error(self, now_ns: int) -> None:
        """Tell the core that the base failed."""
        pack_into("<q", self._exchange, 0, now_ns)
        self._core(self._memory, self._exchange, self._exchange, _FAILED)
