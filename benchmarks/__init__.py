"""Measurements and tables; not part of the installed packages."""
