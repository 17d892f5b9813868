"""The fuzz targets take what they begin with, and that with a few bytes changed; see benchmarks."""

import importlib
import random
import warnings

import pytest

from benchmarks.fuzz.json_mutation import mutated
from benchmarks.fuzz.table import MODULES
from tests.sweeps import seeds

CHANGED = 8
SLOW = ("log-bytes", "log-words")


def target_of(name):
    return importlib.import_module(f"benchmarks.fuzz.{MODULES[name]}").TARGETS[name]


def test_every_target_is_in_the_table_under_the_module_that_has_it():
    for module in set(MODULES.values()):
        found = importlib.import_module(f"benchmarks.fuzz.{module}").TARGETS
        assert set(found) == {name for name in MODULES if MODULES[name] == module}


@pytest.mark.parametrize("name", MODULES)
def test_a_target_takes_its_seeds_whole_cut_and_changed(name):
    target, dice = target_of(name), random.Random(1)
    for seed in target.seeds():
        target.attempt(seed)
        for _ in range(1 if name in SLOW else CHANGED):
            changed = bytearray(seed[: dice.randint(1, len(seed))])
            changed[dice.randrange(len(changed))] = dice.randrange(256)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                target.attempt(bytes(changed))
                if target.mutate is not None:
                    target.attempt(target.mutate(seed, dice.getrandbits(32)))


def test_changed_json_is_the_same_for_the_same_seed_and_never_grows_without_end():
    text = b'{"a": [1, 2.5, {"b": []}], "c": "x", "d": true}'
    for seed in seeds(2_000):
        changed = mutated(text, seed)
        assert changed == mutated(text, seed)
        assert len(changed) < 5_000
