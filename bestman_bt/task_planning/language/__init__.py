"""Language models as planners: an instruction in words goes in, a checked plan comes out, or a refusal in words."""
