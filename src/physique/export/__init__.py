"""What leaves the house: BVH, pictures."""
