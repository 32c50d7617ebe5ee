"""How far to trust a pose: covariance, evidence, verdict, and the result that carries them."""
