"""Logs on disk: writing, reading, repairing and playing them.

The room decides how a log is laid out in MCAP, and which parts of a damaged log can be used.  It
must not know what the messages mean.  Other rooms import `log_file.read_log`, `records.Log`,
`recorder.Recorder` and, without its thread, `log_writer.LogWriter`.
"""
