"""Training of policies: experts, demonstration files, learning."""
