"""The preoperative model: mesh, exact closest points and rays, distance fields, what a scanner can see of it, its cache."""
