"""How lines are taken: where the beam goes, how a place is sampled, and how records become points."""
