"""Language models as planners: from an instruction in words to a checked plan, or a refusal in words."""
