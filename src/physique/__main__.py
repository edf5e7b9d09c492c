"""`python -m physique` is the command `physique`."""

from physique.cli import main

if __name__ == "__main__":
    main()
