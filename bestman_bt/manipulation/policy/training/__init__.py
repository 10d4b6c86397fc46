"""Training of policies: who demonstrates, how demonstrations are kept, and what learns from them."""
