"""The operator's desk: a running fleet seen and commanded over HTTP.

Decides: what a page and a program can ask and tell (routes.py), what is known of the fleet
(known_fleet.py), what needs a person (alarms.py), and who may do what (rights.py).  Must not know:
the fleet core; the desk hears and says what any operator hears and says on the link.
"""
