"""Scenario files and maps: TOML or JSON to a checked Scenario, and back.

The room decides keys, types and defaults of the file.  A new map format is a reader in `maps/`.
Other rooms import `read_scenario` and `parse_scenario` from `scenario_reader`.
"""
