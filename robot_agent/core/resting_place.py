"""Where a robot has come to rest, and when it is to say so.

Decides: what is kept of a place, and that a place is said once, then only when it is asked for.
Must not know: why the robot rests, clocks.  Firmware: imports nothing.
"""


class RestingPlace:
    """The last place of rest; epoch 0: none, the robot may have moved since.

    s [m], off [mm] to the left, turn [mrad] and beyond [mm] are those of Ride; `stood_us` is the
    plan time [us] that has the robot there, which a robot may say while others move: it is not a
    place.
    """

    def __init__(self) -> None:
        self.epoch = self.off = self.turn = self.beyond = self.stood_us = 0
        self.s = 0.0
        self._tell = False

    def keep(
        self, epoch: int, s: float, offset: tuple[int, int, int], stood: float, tell: bool
    ) -> None:
        """Keep a place on the path of an epoch; `stood` [s] is the plan time that has it there."""
        self.epoch, self.s, self._tell = epoch, s, tell
        self.off, self.turn, self.beyond = offset
        self.stood_us = round(1e6 * stood)

    def leave(self) -> None:
        """Forget the place: the robot sets out."""
        self.epoch = 0
        self._tell = False

    def ask(self) -> None:
        """Have the place said once more, if there is one."""
        self._tell = self._tell or self.epoch > 0

    def hush(self) -> None:
        """Say nothing until asked."""
        self._tell = False

    def is_due(self) -> bool:
        """Tell whether to say the place now, which then counts as done."""
        due = self._tell and self.epoch > 0
        self._tell = False
        return due
