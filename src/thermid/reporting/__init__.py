"""What a person reads: tables, figures, diagrams, one page per campaign."""
