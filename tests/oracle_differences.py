"""What a difference makes of a value, as the page makes it; naive."""


def changed(old, by):
    """The value that a difference makes of another one, which stays as it is."""
    if by is None:
        return old
    kind, *rest = by
    if kind == "=":
        return rest[0]
    if kind == "{":
        changes, removed = rest
        kept = {key: value for key, value in old.items() if key not in removed}
        return kept | {key: changed(old.get(key), one) for key, one in changes.items()}
    gone, changes, come = rest
    items = [item for index, item in enumerate(old) if index not in gone]
    for index, one in changes.items():
        items[int(index)] = changed(items[int(index)], one)
    for index, one in come:
        items.insert(index, one)
    return items
