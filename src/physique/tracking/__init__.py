"""HOW: the cost of Eqs. 2 to 9 and the two optimisers that minimise it, window by window."""
