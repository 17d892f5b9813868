"""The requirements of docs/protocol.md by number; a test holds the two against each other.

Decides: numbers, levels and words.  Must not know: how a requirement is tried.
"""

from __future__ import annotations

from typing import Final, NamedTuple


class Requirement(NamedTuple):
    """What a robot must, should or may do; `section`: where docs/protocol.md says how."""

    text: str
    section: str

    @property
    def is_must(self) -> bool:
        """Return whether a robot that does not do it does not conform."""
        return self.text.startswith("must")


REQUIREMENTS: Final[dict[str, Requirement]] = {
    "WIRE-1": Requirement("must drop a message that is not acceptable, and go on", "Encoding"),
    "WIRE-2": Requirement("must ignore fields behind those that it knows", "Encoding"),
    "WIRE-3": Requirement("must read every form of a number, a text and a head", "Encoding"),
    "WIRE-4": Requirement("must drop a Plan whose seal does not fit", "The seal of a Plan"),
    "WIRE-5": Requirement(
        "must not change its state for a message that it hears twice, or late",
        "What is not heard",
    ),
    "WIRE-6": Requirement(
        "must not say where it is, but in `rest` of a Report and `place` of a Hello",
        "What a robot has to do",
    ),
    "HELLO-1": Requirement(
        "must say Hello of version 3 until it holds a plan, with one boot id and within limits",
        "Hello",
    ),
    "HELLO-2": Requirement(
        "must choose another boot id when it is started again, and then wait for a new plan",
        "When robots fail",
    ),
    "HELLO-3": Requirement("should count its Hellos from 1 in `sequence`", "Hello"),
    "HELLO-4": Requirement("should declare its liveliness token", "When robots fail"),
    "PLAN-1": Requirement(
        "must not arm with a Plan of another coordinator or epoch than the newest Command's",
        "What is not heard",
    ),
    "PLAN-2": Requirement(
        "must report fault 4, and not arm, when it holds no acceptable plan",
        "What a robot computes",
    ),
    "PLAN-3": Requirement("must not arm where its plan does not begin", "The states of a robot"),
    "PLAN-4": Requirement(
        "must arm when it holds a plan, stands at its beginning and knows the time",
        "The states of a robot",
    ),
    "CLOCK-1": Requirement(
        "must not arm before it knows the time well enough, within 3 s",
        "The clock filter",
    ),
    "CLOCK-2": Requirement(
        "must ignore answers for another boot id, of a coordinator that it does not obey, "
        "to no open question, and impossible ones",
        "The clock filter",
    ),
    "CLOCK-3": Requirement(
        "must learn the time anew after a Command from the future",
        "The clock filter",
    ),
    "CLOCK-4": Requirement(
        "must stamp its Reports with the coordinator's plan time",
        "What a robot has to do",
    ),
    "LEAD-1": Requirement(
        "must ignore Commands with a sequence that is not higher",
        "What is not heard",
    ),
    "LEAD-2": Requirement("must ignore Commands of a lower (term, boot id)", "Who leads"),
    "LEAD-3": Requirement("must ignore Commands of another run while it is under way", "Who leads"),
    "LEAD-4": Requirement("must obey the next term of its own run, and go on", "Who leads"),
    "GO-1": Requirement("must set out with GO, not before `start_ns`", "How it goes"),
    "GO-2": Requirement(
        "must report done when its plan has ended and it is at its goal, not before",
        "How it goes",
    ),
    "GO-3": Requirement("must stay within `track_mm` of its plan's path", "What a robot has to do"),
    "AUTH-1": Requirement("must not pass the place of its authority", "Authority"),
    "AUTH-2": Requirement(
        "must take nothing from a Command that does not speak for its number",
        "Authority",
    ),
    "AUTH-3": Requirement("must keep the greatest authority that it was granted", "Authority"),
    "AUTH-4": Requirement(
        "must stand where its authority ends, and go on in the same epoch when it is granted more",
        "Authority",
    ),
    "LATE-1": Requirement(
        "must not report more progress than it has made",
        "What a robot has to do",
    ),
    "LATE-2": Requirement(
        "should be on time to 100 ms, when nothing holds it",
        "What a robot has to do",
    ),
    "LATE-3": Requirement(
        "should catch up when it is late, as its speed allows",
        "What a robot has to do",
    ),
    "REPORT-1": Requirement(
        "must report on every change and every 200 ms, with rising sequence and one boot id",
        "Report",
    ),
    "REPORT-2": Requirement(
        "must state a stamp while it drives and when it is done, and none else",
        "What a robot has to do",
    ),
    "STOP-1": Requirement("must brake at once with STOP", "What a robot has to do"),
    "STOP-2": Requirement(
        "must keep its plan, and go on from there with the next GO",
        "What a robot has to do",
    ),
    "COURSE-1": Requirement(
        "must take a further course that its own leads into, and say so in `holds`",
        "Further courses",
    ),
    "COURSE-2": Requirement(
        "must not take one that its own does not lead into, nor go back to an older one",
        "Further courses",
    ),
    "COURSE-3": Requirement(
        "must drive it from its beginning on, and say so in `revision`",
        "Further courses",
    ),
    "COURSE-4": Requirement("must count authority for each course apart", "Further courses"),
    "FREEZE-1": Requirement(
        "must brake along its path with FREEZE, and report frozen",
        "What a robot has to do",
    ),
    "FREEZE-2": Requirement(
        "must report where it rests, once, and again when `wanted` names it",
        "What a robot has to do",
    ),
    "FREEZE-3": Requirement(
        "must not move again in that epoch, but by a further course while Commands say GO",
        "The states of a robot",
    ),
    "FREEZE-4": Requirement(
        "must drop its plan for a later epoch's, and arm with that",
        "When robots fail",
    ),
    "OVER-1": Requirement(
        "may end with OVER",
        "How it goes",
    ),
}
