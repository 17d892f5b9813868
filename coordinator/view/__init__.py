"""Draws plans and logs as pictures, as a page that plays them, and as a live page.

The room decides how things look.  It must not know how plans are made.
"""
