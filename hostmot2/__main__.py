"""`python -m hostmot2` is the hm2 command."""

from hostmot2.cli.main import main

if __name__ == "__main__":
    main()
