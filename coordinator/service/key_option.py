"""The option --keys of commands that open a link.

Decides: the option's name, and that its user is warned before keys expire.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coordinator.base.console import tell
from protocol.badge import Role
from protocol.endpoint import check_reach, endpoint_of, usual_endpoint
from protocol.key_files import KeyFiles, read_key_files

Keys = Annotated[
    Path | None,
    typer.Option("--keys", metavar="DIR", help="Folder of keys; the link is tls/HOST:PORT then."),
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Listen to the network without keys: anybody is heard.")
]


def given_keys(folder: Path | None, role: Role) -> KeyFiles | None:
    """Return the key files of a party in this role, or None if no folder is given.

    In a fleet's folder, the party is the one named after its role.  Raises TransportError.
    """
    if folder is None:
        return None
    files = read_key_files(folder, role)
    if warning := files.warning():
        tell(warning)
    return files


def where_to_listen(listen: str | None, folder: Path | None, insecure: bool) -> str:
    """Return the endpoint to listen on, by default one that only this machine reaches.

    Raises TransportError if the endpoint is malformed or is open to strangers.
    """
    locked = folder is not None
    endpoint = listen or usual_endpoint(locked)
    check_reach(endpoint_of(endpoint, locked), locked, insecure)
    return endpoint
