"""TOML is read as the standard library reads it, but for keys that would take it minutes."""

import re
import time
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.toml_text import toml_of

LONG = ".".join(["a"] * 150)
PIECES = ['"', "'", '"""', "'''", "\\", "#", "\n", " ", ".", "=", "a", "b.c", "[", "]", LONG]


@pytest.mark.parametrize(
    "text",
    [
        f"# {LONG}.b\ntau = 1",
        f'name = "{LONG}.b"',
        f"name = '{LONG}.b'",
        f"name = 'x' # '{LONG}",
        f'name = "an \\" escaped {LONG}.b"',
        f'name = """one " two ""\n{LONG}.b\\"""."""',
        f"name = '''one ' two ''\n{LONG}.b'''",
        f'name = ["""a""", "{LONG}.b"]',
        "x = [" + "1.5, " * 300 + "]",
        ".".join(["a"] * 30) + " = 1",
    ],
)
def test_only_keys_are_counted(text):
    assert toml_of(text) == tomllib.loads(text)


@pytest.mark.parametrize(
    "key",
    [
        ".".join(["a"] * 31),
        " . ".join(["a"] * 31),
        ".".join(["'a.b'"] * 31),
        ".".join(['"a\\"b"'] * 31),
        ".".join(["a", '""'] * 16),
    ],
)
@pytest.mark.parametrize("around", ["{} = 1", "[{}]", "[[ {} ]]", "x={{{}=1}}", "x={{y=1,{}=1}}"])
def test_keys_of_over_thirty_parts_are_told_with_their_line(key, around):
    text = f"name = '''\nb'''\n{around.format(key)}\n"
    tomllib.loads(text)
    with pytest.raises(tomllib.TOMLDecodeError, match=re.escape("30 parts (at line 3)")):
        toml_of(text)


@pytest.mark.parametrize("piece", ['"\\', "'a.", '"a.', "a.", '"', "''", 'a"', "#", "a", '\\".'])
def test_hostile_text_is_looked_at_in_no_time(piece):
    begin = time.process_time()
    with pytest.raises(tomllib.TOMLDecodeError):
        toml_of(piece * 200_000 + "\n=")
    assert time.process_time() - begin < 2.0


@settings(derandomize=True, max_examples=400, deadline=None)
@given(st.lists(st.sampled_from(PIECES), max_size=12).map("".join))
def test_what_the_standard_library_reads_is_read_alike_unless_a_key_is_deep(text):
    try:
        wanted = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises(tomllib.TOMLDecodeError):
            toml_of(text)
        return
    try:
        assert toml_of(text) == wanted
    except tomllib.TOMLDecodeError:
        depth, inner = 0, wanted
        while isinstance(inner, dict) and inner:
            depth, inner = depth + 1, max(inner.values(), key=lambda v: isinstance(v, dict))
        assert depth > 30


@pytest.mark.parametrize(
    ("text", "key", "line"),
    [
        ('name = "a"\nname = "b"', "name", 2),
        ('name = "a"\r\n\r\nname = "b" # again\r\ntau = 1\r\n', "name", 3),
        ('[[robots]]\nid = "x"\n"i d" = 1\n"i d" = [\n  1,\n  2,\n]\nx = 1', '"i d"', 4),
        ("a.b = 1\na . b = 2\n", "a . b", 2),
        ("[a]\nb = 1\n[a.b]\nc = 1", "a.b", 3),
        ("a = 1\n[[ a ]]\nb = 2", "a", 2),
        ("x = 1\nx = {a = 1, b = 2}\n", "x", 2),
    ],
)
def test_a_key_that_is_there_twice_is_named_with_its_line(text, key, line):
    with pytest.raises(tomllib.TOMLDecodeError) as caught:
        toml_of(text)
    said = f"{key}: the key appears more than once in one table (at line {line})"
    assert str(caught.value) == said
