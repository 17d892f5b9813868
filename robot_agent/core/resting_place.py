"""Where a robot has come to rest, and when it is to report that.

Decides: what is stored of a place, and that it is reported once and then only on request.
Must not know: why the robot rests, clocks.  Firmware: imports nothing.
"""


class RestingPlace:
    """The last place of rest; epoch 0 means that there is none: the robot may have moved since.

    s [m] is the arc length; off [mm] to the left, turn [mrad] and beyond [mm] are the offset of
    PathFollower.
    """

    def __init__(self) -> None:
        self.epoch = self.revision = self.off = self.turn = self.beyond = 0
        self.s = 0.0
        self._tell = False

    def keep(
        self, epoch: int, revision: int, s: float, offset: tuple[int, int, int], tell: bool
    ) -> None:
        """Store a place on the path of one of an epoch's courses.

        `tell`: whether the place is to be reported without a request.
        """
        self.epoch, self.revision, self.s, self._tell = epoch, revision, s, tell
        self.off, self.turn, self.beyond = offset

    def leave(self) -> None:
        """Forget the place: the robot sets out."""
        self.epoch = 0
        self._tell = False

    def ask(self) -> None:
        """Request that the place be reported once more, if there is one."""
        self._tell = self._tell or self.epoch > 0

    def hush(self) -> None:
        """Do not report the place until it is requested again."""
        self._tell = False

    def is_due(self) -> bool:
        """Return whether to report the place now; if so, it counts as reported."""
        due = self._tell and self.epoch > 0
        self._tell = False
        return due
