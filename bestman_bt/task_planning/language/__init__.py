"""Language models as planners: from an instruction as text to a checked plan, or a refusal with its reason."""
