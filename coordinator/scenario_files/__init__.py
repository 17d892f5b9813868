"""Scenario files and maps: TOML or JSON to a checked Scenario, and back.

The room decides keys, types and defaults of the file.  A new map format is added as a reader in
`maps/`.  Other rooms use `scenario_reader.read_scenario` and `parse_scenario`.
"""
