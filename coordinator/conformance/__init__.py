"""Plays coordinator to one robot that somebody else wrote, and judges it by docs/protocol.md.

The room decides what such a robot is told, and which requirements of the page hold by what it says.
It must not know how the coordinator's own rooms do the same: it judges by `protocol/` alone.  Nor
does it know links, clocks, files or threads.  Other rooms import `examiner.Examiner`.
"""
