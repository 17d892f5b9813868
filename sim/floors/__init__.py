"""Generated scenarios: kinds of floors, and places for robots on them.

A new kind is a module here and an entry in `generator.py`.
"""
