"""The proof that a plan is safe, from its wire bytes alone.

The room decides whether a plan is tau-safe, keeps clear of obstacles and within limits.  It imports
nothing that searches: an import contract keeps it apart.  Others take `tau_safety.prove` and
`verify`.
"""
