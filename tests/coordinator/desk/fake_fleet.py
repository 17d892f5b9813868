"""A fleet that answers an operator at once, on a link without a network."""

import threading

from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    END,
    HALT,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Admit,
    Block,
    Cancel,
    Command,
    Join,
    Leave,
    Order,
    OrderState,
    Refusal,
    Report,
    Tell,
    Unblock,
)
from protocol.phases import DONE, GO, STOP
from protocol.transport import Transport

FLEET = "hall"


def a_report(phase=DONE, fault=0, late=0):
    return Report(7, 1, 1, phase, fault, None, 1_000, late)


def a_command(phase=GO, epoch=1, said_ns=0, boot=1):
    return Command(boot, term=1, sequence=1, epoch=epoch, phase=phase, start_ns=0, said_ns=said_ns)


class FakeFleet(Transport):
    """A link whose other side answers every operator's message from a thread, like a real one.

    `said` are the messages that arrived.  Orders for R9 and robots that are not R1 are refused; the
    second order for R1 waits for ever, and R7 is admitted without a course.  There is an order
    `taken` to (9, 5) for R1.
    """

    def __init__(self):
        self.said = []
        self.phase = GO
        self.is_deaf = False
        self._busy = set()
        self._handlers = []

    def subscribe(self, key_expression, handler):
        self._handlers.append((key_expression.split("/"), handler))

    def tell(self, key, message):
        payload = message if isinstance(message, bytes) else encode(message)
        for expression, handler in self._handlers:
            if keys.fits(expression, key.split("/")):
                handler(key, payload, None)

    def put(self, key, payload):
        _, kind, name = keys.split(key)
        message = decode(kind, payload)
        self.said.append(message)
        if not self.is_deaf:
            threading.Thread(target=self._answer, args=(message, name)).start()

    def beat(self):
        self.tell(keys.command(FLEET), a_command(self.phase))

    def _answer(self, message, name):
        if isinstance(message, Order) and message.id == "taken":
            known = Order(message.boot, "taken", (9.0, 5.0), "R1")
            self.tell(keys.orders(FLEET, "taken"), known)
        elif isinstance(message, Order):
            is_known = message.robot in ("", "R1")
            waits = message.after or message.robot in self._busy
            state = UNDER_WAY if is_known and not waits else WAITING
            why = "" if is_known else f"there is no robot {message.robot} in this fleet"
            if message.robot in self._busy:
                why = "R1 does another one first"
            self._busy.add(message.robot or "R1")
            self._state(message.id, state if is_known else REFUSED, message.robot, why)
        elif isinstance(message, Cancel):
            known = {"done": ORDER_DONE, "under-way": 3, "refused": REFUSED}
            state, why = known.get(message.id, REFUSED), "there is no such order"
            self._state(message.id, state, "", why, 5 if message.id in known else None)
        elif isinstance(message, Leave | Join):
            kind = "leave" if isinstance(message, Leave) else "join"
            refused = message.robot == "R9"
            why = "R9 does not rest" if refused else ""
            state = REFUSED if refused else ORDER_DONE
            self._state(f"{kind}-{message.robot}", state, message.robot, why)
        elif isinstance(message, Block | Unblock):
            self.tell(keys.blocks(FLEET, message.id), message)
        elif isinstance(message, Admit) and name != "R7":
            self.tell(keys.plan(FLEET, name), Refusal(message.boot, f"{name} has arrived already"))
        elif isinstance(message, Tell):
            self.phase = {HALT: STOP, END: self.phase}.get(message.what, GO)
            self.beat()

    def _state(self, name, state, robot, reason, released_ms=5):
        told = OrderState(name, state, robot, released_ms=released_ms, reason=reason)
        self.tell(keys.orders(FLEET, name), told)

    def declare_alive(self, key):
        pass

    def watch_alive(self, key_expression, handler):
        pass

    def close(self):
        self._handlers.clear()
