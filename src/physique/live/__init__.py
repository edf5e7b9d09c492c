"""A page in the browser that plays runs, and lets people push the bodies."""
