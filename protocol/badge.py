"""Whom a certificate identifies: its common name states a role, a name and a generation.

Decides: what common names look like.  Must not know: certificates, links, what a role may do.

When a revoked name gets a new certificate, its generation is one higher, so that the old
certificate remains refused.
"""

from __future__ import annotations

import re
from typing import Final, Literal, NamedTuple, cast, get_args

from protocol.keys import NAME

Role = Literal["coordinator", "router", "robot", "observer", "operator"]
ROLES: Final[tuple[Role, ...]] = get_args(Role)

_COMMON_NAME: Final = re.compile(rf"({'|'.join(ROLES)})/({NAME.pattern})/([1-9][0-9]{{0,8}})")


class Badge(NamedTuple):
    """A role, a name and a generation: which certificate of this role and name it is, from 1."""

    role: Role
    name: str
    generation: int

    @property
    def common_name(self) -> str:
        """Return the common name, as in robot/R1/2; at most 52 of the 64 characters allowed."""
        return f"{self.role}/{self.name}/{self.generation}"

    @property
    def who(self) -> str:
        """Return the badge in words, as in `robot R1, key 2`."""
        return f"{self.role} {self.name}, key {self.generation}"


def badge_of(common_name: str) -> Badge | None:
    """Return the badge that a common name states; None when the name is not of this form."""
    parts = _COMMON_NAME.fullmatch(common_name)
    if parts is None:
        return None
    return Badge(cast(Role, parts[1]), parts[2], int(parts[3]))
