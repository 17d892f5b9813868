"""The exchanges that are tried, as data: what a robot is told, and what it has to do then.

Decides: which requirements each exchange tries, and when they hold.  Must not know: links, clocks.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import msgspec

from coordinator.conformance.exam import Exam, Script, Until
from coordinator.conformance.wire_forms import (
    in_long_forms,
    plain,
    spoilt,
    with_later_fields,
    with_wrong_seal,
)
from protocol import keys
from protocol.codec import encode
from protocol.messages import Clock, Hello, Plan, Report
from protocol.phases import (
    ARMED,
    BAD_PLAN,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OFF_PATH,
    STOP,
)
from protocol.timing import CLOCK_PERIOD, LATE_STEP_MS, MILLISECOND, SECOND

ENOUGH_MS: Final = 60_000
"""A headroom [ms] that no course outlasts."""

SLOW: Final = 200 * MILLISECOND
"""An answer to a question about the time takes so long that the time is not known from it: from
the first one on, so that a robot does not know it before that is tried."""

READING: Final = 3 * SECOND
"""How long [ns] a small robot may read a Plan, a part in each tick."""

PERSON: Final = 120 * SECOND
"""How long [ns] a person has to start the robot's program again."""


class Exchange(NamedTuple):
    """A dialogue; `tries`: the requirements that it decides on."""

    name: str
    tries: tuple[str, ...]
    script: Callable[[Exam], Script]


def _hello(exam: Exam) -> Script:
    stage = exam.stage
    heard = yield Until(lambda: len(stage.hellos) >= 4, 2 * SECOND)
    exam.judge("HELLO-1", heard, f"says {len(stage.hellos)} Hellos in 2 s")
    exam.judge("HELLO-4", stage.robot in stage.alive, "no liveliness token was seen")
    exam.look_at_hellos()
    course = exam.begin_epoch(4.0)
    replaced = msgspec.structs.replace
    for number, what, payload in (
        ("WIRE-4", "a wrong seal", with_wrong_seal(course.plan)),
        ("PLAN-1", "another coordinator", encode(replaced(course.plan, boot=stage.boot ^ 1))),
        ("PLAN-1", "another epoch", encode(replaced(course.plan, epoch=stage.epoch + 3))),
        ("PLAN-2", "a profile of another length", encode(_too_short(course.plan))),
    ):
        stage.bad_plan = payload
        hellos, since = len(stage.hellos), len(stage.reports)
        yield from exam.pause(900)
        if number == "PLAN-2":
            yield Until(partial(_is_refused, exam, since), READING)
        report = stage.report
        took = report is not None and report.epoch != 0
        exam.judge(number, not took, f"holds a plan with {what}")
        still = len(stage.hellos) > hellos or took
        exam.judge("WIRE-1", still, f"says no Hello after a plan with {what}")
        if not still:
            yield from exam.pause(1_500)
            return
        if number == "PLAN-2":
            text = f"{exam.said_phase()} for a plan with {what}"
            exam.judge(number, _is_refused(exam, since), text)
    stage.bad_plan = None


def _is_refused(exam: Exam, since: int) -> bool:
    """Return whether a Report since the one of this number says that the plan is not valid."""
    said = [one.message for one in exam.stage.reports[since:]]
    return any(isinstance(one, Report) and one.fault == BAD_PLAN for one in said)


def _too_short(plan: Plan) -> Plan:
    """Return the plan without its last speed knot."""
    return msgspec.structs.replace(plan, profile=plan.profile[:-5])


def _clock(exam: Exam) -> Script:
    stage = exam.stage
    exam.begin_epoch(4.0)
    yield Until(lambda: exam.is_in(IDLE), SECOND)
    yield from exam.pause(900)
    exam.judge("CLOCK-1", not exam.is_in(ARMED), "arms with answers that took 0.2 s")
    report = stage.report
    unsure = report is not None and report.fault == CLOCK_UNSURE
    exam.judge("CLOCK-1", unsure, f"{exam.said_phase()} while it cannot know the time")
    stage.on_question = lambda asked: _mislead(exam, asked)
    yield from exam.pause(900)
    stage.on_question = lambda _: None
    exam.judge("CLOCK-2", not exam.is_in(ARMED), "arms with answers that are not for it")
    stage.clock_delay_ns = 0
    armed = yield Until(lambda: exam.is_in(ARMED), 3 * SECOND)
    exam.judge("PLAN-4", armed, f"{exam.said_phase()} for 3 s where its plan begins")
    if armed:
        yield from _still_knows(exam, _mislead, "answers that are not for it")
        yield from _still_knows(exam, _answer_again, "answers to questions that have theirs")


def _still_knows(exam: Exam, mislead: Callable[[Exam, Clock], None], what: str) -> Script:
    """Mislead an armed robot about the time until it has asked again; it must stay armed."""
    stage, heard = exam.stage, len(exam.stage.reports)
    stage.on_question = lambda asked: mislead(exam, asked)
    yield from exam.pause((CLOCK_PERIOD + SECOND) // MILLISECOND)
    stage.on_question = lambda _: None
    said = [one.message for one in stage.reports[heard:]]
    sure = all(isinstance(one, Report) and one.phase == ARMED for one in said)
    exam.judge("CLOCK-2", sure, f"doubts the time because of {what}")


def _mislead(exam: Exam, asked: Clock) -> None:
    """Answer for another process or coordinator, or impossibly, as if we knew the time exactly."""
    stage = exam.stage
    key, own = keys.clock(stage.fleet, stage.robot or ""), stage.boot
    wrong_ns = stage.now_ns + 5 * SECOND
    for answer in (
        Clock(asked.boot ^ 1, asked.sent_ns, wrong_ns, wrong_ns, own),
        Clock(asked.boot, asked.sent_ns, wrong_ns, wrong_ns, own ^ 1),
        Clock(asked.boot, asked.sent_ns, wrong_ns, wrong_ns),
        Clock(asked.boot, asked.sent_ns, wrong_ns, wrong_ns - SECOND, own),
        Clock(asked.boot, asked.sent_ns + SECOND, wrong_ns, wrong_ns, own),
        Clock(asked.boot, asked.sent_ns - MILLISECOND, wrong_ns, wrong_ns, own),
    ):
        stage.send(key, encode(answer))


def _answer_again(exam: Exam, asked: Clock) -> None:
    """Answer once more, and wrongly, after the answer that the stage gives."""
    stage = exam.stage
    wrong_ns = stage.now_ns + 5 * SECOND
    answer = Clock(asked.boot, asked.sent_ns, wrong_ns, wrong_ns, stage.boot)
    stage.send(keys.clock(stage.fleet, stage.robot or ""), encode(answer), 200 * MILLISECOND)


def _drive(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    exam.go()
    finish = stage.course.finish_ms
    yield from exam.until_ms(-100)
    early = max((claim.passed_ms for claim in exam.claims()), default=-1)
    exam.judge("GO-1", early <= 100, f"claims plan time {early} ms before the start")
    yield from exam.until_ms(1_000)
    exam.judge("GO-1", exam.is_in(MOVING), f"{exam.said_phase()} 1 s after the start")
    done = yield from exam.arrives(finish + 2_000)
    exam.judge("GO-2", done, f"{exam.said_phase()} 2 s after its plan has ended")
    dones = [claim for claim in exam.claims() if claim.report.phase == DONE]
    first = min((claim.at_ms for claim in dones), default=finish)
    exam.judge("GO-2", first >= finish - 50, f"is done {finish - first} ms before its plan ends")
    late = max((claim.report.late for claim in exam.claims()), default=0)
    exam.judge("LATE-2", late <= 2, f"reports to be {late * LATE_STEP_MS} ms late")


def _held(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    course = stage.course
    finish, number = course.finish_ms, course.plan.number
    end = finish // 2
    stage.held = {number: end}
    exam.go()
    yield from exam.until_ms(end + 1_500)
    beyond = any(exam.goes_beyond(claim, course, end) for claim in exam.claims())
    waits = exam.is_in(MOVING)
    stage.first, stage.headroom_ms, stage.held = number + 1, ENOUGH_MS, {}
    yield from exam.until_ms(end + 3_500)
    more = any(exam.goes_beyond(claim, course, end) for claim in exam.claims(end + 1_500))
    waits = waits and exam.is_in(MOVING)
    exam.judge("AUTH-4", waits, f"{exam.said_phase()} where its authority ends")
    granted = stage.plan_ms
    stage.first = 0
    done = yield from exam.arrives(granted + finish - end + 2_500)
    early = done and stage.plan_ms < granted + 0.5 * (finish - end)
    said = f"claims a place beyond plan time {end} ms, its authority"
    exam.judge("AUTH-1", not (early and (beyond or not more)), f"{said}, and was there")
    exam.judge("AUTH-2", beyond or not (early and more), "drives on by Commands for other numbers")
    exam.judge("LATE-1", early or not (beyond or more), f"{said}, and was not there")
    exam.judge("AUTH-4", done, f"{exam.said_phase()} long after it is granted more")


def _silence(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    course = stage.course
    exam.go()
    yield from exam.until_ms(1_000)
    stage.speaks = False
    yield from exam.pause(4_000)
    end = exam.stage.authority_ms(course.plan.number)
    beyond = any(exam.goes_beyond(claim, course, end) for claim in exam.claims())
    waits, said = exam.is_in(MOVING), exam.said_phase()
    stage.speaks = True
    granted = stage.plan_ms
    done = yield from exam.arrives(granted + course.finish_ms - end + 2_500)
    early = done and stage.plan_ms < granted + 0.5 * (course.finish_ms - end)
    exam.judge("AUTH-1", not early, "drives on when no Command comes")
    exam.judge("LATE-1", early or not beyond, "claims to drive on when no Command comes")
    exam.judge("AUTH-4", waits, f"{said} when no Command comes for 4 s")
    exam.judge("AUTH-4", done, f"{exam.said_phase()} long after Commands came again")


def _stop(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    course = stage.course
    exam.go()
    yield from exam.until_ms(1_800)
    stage.phase, stopped_ns, at_ms = STOP, stage.now_ns, stage.plan_ms
    stopping = exam.pace.speed / exam.pace.accel
    brakes_ms = round(1_000.0 * stopping)
    yield from exam.pause(brakes_ms + 500)
    first = exam.claims()[-1:]
    yield from exam.pause(1_200)
    last = exam.claims()[-1:]
    moved = last[0].passed_ms - first[0].passed_ms if first and last else 0
    exam.judge("STOP-1", moved <= 100, f"goes on by {moved} ms of its plan after STOP")
    went = last[0].passed_ms - at_ms if last else 0
    exam.judge("STOP-1", went <= brakes_ms + 300, f"takes {went} ms of its plan to stop")
    exam.judge("STOP-2", exam.is_in(MOVING), f"{exam.said_phase()} after STOP")
    exam.drives[-1].stops.append((stopped_ns, stage.now_ns))
    stage.phase = GO
    exam.start_at(stage.start_ns + stage.now_ns - stopped_ns)
    done = yield from exam.arrives(course.finish_ms + 2_500)
    exam.judge("STOP-2", done, f"{exam.said_phase()} long after the next GO")


def _course(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready(6.0)):
        return
    old = stage.course
    exam.go()
    yield from exam.until_ms(1_500)
    end = stage.authority_ms(old.plan.number)
    stage.held = {old.plan.number: end}
    x, y, heading = old.pose_at(old.s_at(end))
    stage.plans.append(exam.new_course((x + 0.3, y, heading), 3.0, 1, end))
    yield from exam.pause(500)
    report = stage.report
    took = report is not None and report.holds != 0
    exam.judge("COURSE-2", not took, "holds a course that begins 0.3 m from its own")
    new = exam.new_course((x, y, heading), 3.0, 1, end)
    stage.plans[1] = new
    stage.held[new.plan.number] = 0
    holds = yield Until(lambda: _holds(exam, 1), SECOND)
    exam.judge("COURSE-1", holds, "does not hold a course that its own leads into, in 1 s")
    changed = yield Until(
        lambda: exam.is_in(MOVING, 1), (end - stage.plan_ms + 3_000) * MILLISECOND
    )
    said = f"{exam.said_phase()} on its old course 3 s after the new one has begun"
    exam.judge("COURSE-3", changed, said)
    if not changed:
        return
    exam.judge("COURSE-3", stage.plan_ms >= end - 100, "changes before its course begins")
    yield from exam.pause(1_000)
    claims = [claim for claim in exam.claims() if claim.report.revision == 1]
    beyond = any(exam.goes_beyond(claim, new, end) for claim in claims)
    exam.judge("COURSE-4", not beyond, "drives its new course before anything is granted on it")
    granted, stage.held = stage.plan_ms, {}
    done = yield from exam.arrives(granted + new.finish_ms - end + 2_500, 1)
    exam.judge("COURSE-3", done, f"{exam.said_phase()} at the end of a further course")
    if done:
        yield from _course_from_goal(exam)


def _course_from_goal(exam: Exam) -> Script:
    stage = exam.stage
    course = stage.course
    goal = course.pose_at(course.curve.length)
    next_one = exam.new_course(goal, 2.0, 2, stage.plan_ms + 800)
    stage.plans.append(next_one)
    stage.held = {next_one.plan.number: 0}
    holds = yield Until(lambda: _holds(exam, 2), SECOND)
    exam.judge("COURSE-1", holds, "does not hold a course from its goal, in 1 s")
    yield Until(lambda: exam.is_in(MOVING, 2), 3 * SECOND)
    stage.held = {}
    done = yield from exam.arrives(max(stage.plan_ms, next_one.finish_ms) + 4_000, 2)
    exam.judge("COURSE-3", done, f"{exam.said_phase()} after a course from its goal")
    older = exam.new_course(next_one.pose_at(next_one.curve.length), 2.0, 1, stage.plan_ms)
    stage.send(stage.plan_key(), encode(older.plan))
    yield from exam.pause(500)
    report = stage.report
    back = done and (report is None or (report.revision, report.holds) != (2, 2))
    exam.judge("COURSE-2", not back, "goes back to an older course")


def _holds(exam: Exam, revision: int) -> bool:
    report = exam.stage.report
    return report is not None and report.holds == revision


def _freeze(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    course = stage.course
    exam.go()
    yield from exam.until_ms(2_000)
    claimed = exam.claims()[-1:]
    stage.phase = FREEZE
    heard = len(stage.reports)
    frozen = yield Until(lambda: exam.is_in(FROZEN), 4 * SECOND)
    exam.judge("FREEZE-1", frozen, f"{exam.said_phase()} 4 s after FREEZE")
    if not frozen:
        return
    yield from exam.pause(800)
    rests = _rests(exam, heard)
    exam.judge("FREEZE-2", len(rests) == 1, f"says {len(rests)} times where it rests, unasked")
    asked = len(stage.reports)
    stage.wanted = True
    yield Until(lambda: bool(_rests(exam, asked)), SECOND)
    stage.wanted = False
    exam.judge("FREEZE-2", bool(_rests(exam, asked)), "does not say where it rests when asked")
    yield from exam.pause(300)
    rests = _rests(exam, heard)
    if rests and claimed:
        rest = rests[0].rest
        assert rest is not None
        least = course.s_at(claimed[0].passed_ms) - 0.02
        most = course.s_at(stage.authority_ms(course.plan.number)) + 0.02
        where = f"says that it rests at {rest.s_m:.3f} m, not between {least:.3f} and {most:.3f}"
        exam.judge("FREEZE-2", least <= rest.s_m <= most and rest.epoch == stage.epoch, where)
    stage.phase = GO
    yield from exam.pause(1_000)
    exam.judge("FREEZE-3", exam.is_in(FROZEN), f"{exam.said_phase()} with GO after FREEZE")
    again = yield from exam.ready()
    exam.judge("FREEZE-4", again, f"{exam.said_phase()} with the plan of the next epoch")


def _rests(exam: Exam, since: int) -> list[Report]:
    """Return the reports since the one with an index that say where the robot rests."""
    later = [heard.message for heard in exam.stage.reports[since:]]
    return [one for one in later if isinstance(one, Report) and one.rest is not None]


def _elsewhere(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.settle()) or exam.place is None:
        return
    x, y, heading = exam.place
    exam.begin_epoch(4.0, (x + 1.0, y, heading))
    yield from exam.pause(1_500)
    report = stage.report
    exam.judge("PLAN-3", not exam.is_in(ARMED), "arms 1 m from where its plan begins")
    fault = report is not None and report.fault == OFF_PATH
    exam.judge("PLAN-3", fault, f"{exam.said_phase()} 1 m from where its plan begins")
    stage.epoch += 1  # So that it drops the plan; it stands where it stood.
    stage.plans, stage.phase = [], HOLD
    yield Until(lambda: stage.report is not None and stage.report.epoch == 0, 2 * SECOND)


def _future(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    yield from exam.pause(1_000)
    asked, heard = len(stage.questions), len(stage.reports)
    stage.answers = False
    said = stage.command(said_ns=stage.now_ns + 5 * SECOND)
    stage.send(keys.command(stage.fleet), encode(said))
    yield from exam.pause(400)
    stage.answers = True
    reports = [one.message for one in stage.reports[heard:]]
    unsure = any(isinstance(one, Report) and one.fault == CLOCK_UNSURE for one in reports)
    asks = len(stage.questions) - asked
    exam.judge("CLOCK-3", unsure or asks > 2, "goes on as if it knew the time")
    armed = yield Until(lambda: exam.is_in(ARMED), 3 * SECOND)
    exam.judge("CLOCK-3", armed, f"{exam.said_phase()} 3 s after a Command from the future")


def _restart(exam: Exam) -> Script:
    stage = exam.stage
    if not (yield from exam.ready()):
        return
    exam.go()
    yield from exam.arrives(stage.course.finish_ms + 2_000)
    before = stage.report
    if before is None or not (yield from exam.settle()):
        return
    stage.plans, heard = [], len(stage.hellos)
    where = "" if exam.place is None else " at {:.3f} {:.3f} {:.3f}".format(*exam.place)
    exam.asks_person = f"start the program of {stage.robot} again now, where it stands{where}"
    came = yield Until(lambda: len(stage.hellos) > heard, PERSON)
    exam.asks_person = ""
    exam.judge("HELLO-2", came, "says no Hello after it was to be started again")
    hellos = [one.message for one in stage.hellos[heard:]]
    same = any(isinstance(one, Hello) and one.boot == before.boot for one in hellos)
    exam.judge("HELLO-2", not same, "has the boot id that it had before")
    yield from exam.pause(1_500)
    report = stage.report
    holds = report is None or (report.epoch == 0 and report.phase == IDLE)
    exam.judge("HELLO-2", holds, f"{exam.said_phase()} before it has got a plan")
    exam.begin_epoch(4.0)
    armed = yield Until(lambda: exam.is_in(ARMED), 6 * SECOND)
    exam.judge("HELLO-2", armed, f"{exam.said_phase()} with the plan of the next epoch")


def _nothing(_: Exam) -> None:
    """Change nothing."""


def _undisturbed(
    number: str,
    what: str,
    disturb: Callable[[Exam], None] = _nothing,
    prepare: Callable[[Exam], None] = _nothing,
) -> Exchange:
    """Return an exchange in which a robot has to drive as if nothing had happened.

    `prepare` is called before its epoch, `disturb` ten times in the second second of its drive.
    """

    def script(exam: Exam) -> Script:
        stage = exam.stage
        if not (yield from exam.settle()):
            return
        if prepare is not _nothing:
            # What fails without the change is not blamed on it.
            if not (yield from exam.ready()) or not (yield from exam.settle()):
                return
            prepare(exam)
        if not (yield from exam.ready()):
            if stage.form is not plain or stage.twice:
                exam.judge(number, False, f"{exam.said_phase()}, and does not arm {what}")
            exam.plain()
            return
        exam.go()
        finish = stage.course.finish_ms
        for tenth in range(10):
            yield from exam.until_ms(1_000 + 100 * tenth)
            disturb(exam)
        yield from exam.until_ms(2_600)
        held = exam.phases(-400) & {BRAKING, FROZEN, IDLE}
        exam.judge(number, not held and stage.heard_within(SECOND), f"{exam.said_phase()} {what}")
        done = yield from exam.arrives(finish + 1_500)
        late = max((claim.report.late for claim in exam.claims()), default=0) * LATE_STEP_MS
        exam.judge(number, done, f"{exam.said_phase()} after its plan has ended {what}")
        exam.judge(number, late <= 500, f"gets {late} ms late {what}")
        exam.plain()

    return Exchange(what, (number,), script)


def _older(exam: Exam) -> None:
    stage = exam.stage
    for back in (5, 10, 30):  # A link may have lost the newest.
        old = stage.command(phase=FREEZE, sequence=stage.sequence - back)
        stage.sequence -= 1
        stage.send(keys.command(stage.fleet), encode(old), 20 * MILLISECOND)


def _lower(exam: Exam) -> None:
    _claim_to_lead(exam, term=exam.stage.term - 1, boot=exam.stage.boot + 1)
    _claim_to_lead(exam, boot=exam.stage.boot - 1)


def _other_run(exam: Exam) -> None:
    stage = exam.stage
    _claim_to_lead(exam, term=stage.term + 1, run=stage.run ^ 1)
    _claim_to_lead(exam, boot=stage.boot + 1, run=stage.run ^ 1)


def _claim_to_lead(exam: Exam, **fields: int) -> None:
    """Say FREEZE as another coordinator."""
    stage = exam.stage
    said = stage.command(phase=FREEZE, **fields)
    said = msgspec.structs.replace(said, sequence=said.sequence + 1_000)
    stage.sequence -= 1
    stage.send(keys.command(stage.fleet), encode(said))


def _takes_over(exam: Exam) -> None:
    """Go on as the coordinator of the next term, while the former one says FREEZE."""
    stage = exam.stage
    former = stage.course.plan.boot
    if stage.boot != former:
        _claim_to_lead(exam, term=stage.term - 1, boot=former)
        return
    stage.term, stage.boot, stage.sequence = stage.term + 1, stage.boot - 1, 0


def _malformed(exam: Exam) -> None:
    stage = exam.stage
    freeze = stage.command(phase=FREEZE)
    stage.sequence -= 1
    robot = stage.robot or ""
    plan = msgspec.structs.replace(stage.course.plan, revision=1)
    for key, message in (
        (keys.command(stage.fleet), freeze),
        (keys.plan(stage.fleet, robot), plan),
        (keys.clock(stage.fleet, robot), Clock(0, 0, 0, 0)),
    ):
        for payload in spoilt(message):
            stage.send(key, payload)
    stage.send(keys.clock(stage.fleet, robot), encode(freeze))


def _late_copies(exam: Exam) -> None:
    stage = exam.stage
    for told in stage.said[-12:-8]:
        stage.send(keys.command(stage.fleet), encode(told.command))
    stage.send(stage.plan_key(), encode(stage.course.plan))


def _twice(exam: Exam) -> None:
    exam.stage.twice = True


def _later_fields(exam: Exam) -> None:
    exam.stage.form = with_later_fields


def _long_forms(exam: Exam) -> None:
    exam.stage.form = in_long_forms


def _kept(exam: Exam) -> None:
    """Grant the whole course once it is under way, and hardly anything afterwards."""
    stage = exam.stage
    number = stage.course.plan.number
    if number not in stage.held:
        stage.say(stage.command(headroom_ms=ENOUGH_MS))
        stage.held = {number: 1_100}


EXCHANGES: Final[tuple[Exchange, ...]] = (
    Exchange(
        "a robot introduces itself",
        ("HELLO-1", "HELLO-3", "HELLO-4", "WIRE-1", "WIRE-4", "WIRE-6", "PLAN-1", "PLAN-2"),
        _hello,
    ),
    Exchange("it learns the time and arms", ("CLOCK-1", "CLOCK-2", "PLAN-4"), _clock),
    Exchange(
        "it drives a course on time",
        ("GO-1", "GO-2", "LATE-2", "CLOCK-4", "REPORT-1", "REPORT-2", "PLAN-4"),
        _drive,
    ),
    Exchange("its authority ends", ("AUTH-1", "AUTH-2", "AUTH-4", "LATE-1"), _held),
    Exchange("no Command comes", ("AUTH-1", "AUTH-4", "LATE-1"), _silence),
    _undisturbed("AUTH-3", "when less is granted than before", _kept),
    Exchange("it is stopped", ("STOP-1", "STOP-2"), _stop),
    Exchange("it is sent on", ("COURSE-1", "COURSE-2", "COURSE-3", "COURSE-4"), _course),
    _undisturbed("LEAD-1", "when older Commands say FREEZE", _older),
    _undisturbed("LEAD-2", "when a former coordinator says FREEZE", _lower),
    _undisturbed("LEAD-3", "when the coordinator of another run says FREEZE", _other_run),
    _undisturbed("WIRE-1", "when messages are malformed", _malformed),
    _undisturbed("WIRE-2", "when messages have fields from the future", prepare=_later_fields),
    _undisturbed("WIRE-3", "when numbers and heads have long forms", prepare=_long_forms),
    _undisturbed("WIRE-5", "when messages come twice and late", _late_copies, _twice),
    _undisturbed("LEAD-4", "when the next coordinator takes over", _takes_over),
    Exchange("a Command comes from the future", ("CLOCK-3",), _future),
    Exchange("it is frozen", ("FREEZE-1", "FREEZE-2", "FREEZE-3", "FREEZE-4"), _freeze),
    Exchange("its plan begins elsewhere", ("PLAN-3",), _elsewhere),
)
"""In the order in which they are tried."""

RESTART: Final = Exchange("it is started again", ("HELLO-2",), _restart)
"""Needs a person, or a script, that starts the robot's program again."""
