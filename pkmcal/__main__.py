"""`python -m pkmcal`: the command `pkmcal`, also where its script is not on the path."""

from pkmcal.cli.main import main

if __name__ == "__main__":
    main()
