"""Logs on disk: written, read, mended, followed.

The room decides how a log is laid out in MCAP and what of a damaged one counts.  It must not know
what the messages mean.  Other rooms import `log_file.read_log`, `records.Log` and
`recorder.Recorder`.
"""
