"""Who may take part: certificates, their register, key files, and who was refused.

The room decides which keys count.  It must not know what messages mean.
"""
