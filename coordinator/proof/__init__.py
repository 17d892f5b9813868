"""The proof that a plan is safe, from its wire bytes alone.

The room decides whether a plan is tau-safe, clear of obstacles and within limits.  It must not
import any code that searches for plans; an import contract forbids that.  Other rooms import
`verify` and `wording`.
"""
