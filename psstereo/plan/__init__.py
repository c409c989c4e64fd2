"""What a capture needs and what it does not: survey, facts, plan, run."""
