"""Access control: certificates, their register, key files, and refusals.

The room decides which keys are valid.  It must not know what messages mean.
"""
