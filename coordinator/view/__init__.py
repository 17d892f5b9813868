"""Pictures: plans and logs drawn, played as a page, followed live.

The room decides how things look.  It must not know how plans are made.
"""
